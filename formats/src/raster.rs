//! Pictures out of pixels, as PNG.

/// A picture of so many columns and rows, row by row from above, as a PNG file. Quick rather than small:
/// nobody should wait for a picture.
///
/// # Errors
/// If it is too large for a PNG file or for memory.
pub(crate) fn png(
    pixels: &[[u8; 3]],
    (columns, rows): (u32, u32),
) -> Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::with_capacity(pixels.len());
    let mut encoder = png::Encoder::new(&mut file, columns, rows);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Up);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels.as_flattened())?;
    writer.finish()?;
    Ok(file)
}
