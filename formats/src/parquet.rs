//! `path.parquet`: the path as a table of Apache Parquet, the columns of `path.csv`.
//!
//! All are doubles; `y` and the contact are null where nothing is in reach. Values are as they are, neither
//! encoded nor compressed: next to none of them comes twice.

use std::io::{self, Write};
use std::sync::Arc;

use horma_core::Waypoint;
use parquet::basic::{Repetition, Type as Physical};
use parquet::data_type::DoubleType;
use parquet::errors::Result;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::columns;

/// Positions of a row group.
const GROUP: usize = 1 << 20;

/// Writes a path.
pub(crate) fn write(path: &[Waypoint], out: &mut (impl Write + Send)) -> io::Result<()> {
    table(path, out).map_err(io::Error::other)
}

fn table(path: &[Waypoint], out: &mut (impl Write + Send)) -> Result<()> {
    let units = KeyValue::new("units".to_owned(), "mm, degrees".to_owned());
    let properties = WriterProperties::builder()
        .set_dictionary_enabled(false)
        .set_created_by(concat!("horma ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(vec![units]))
        .build();
    let mut writer = SerializedFileWriter::new(out, schema()?, Arc::new(properties))?;
    for group in path.chunks(GROUP) {
        let mut rows = writer.next_row_group()?;
        for k in 0..columns::names().count() {
            let column = group.iter().map(|w| columns::of(w)[k]);
            let there: Vec<f64> = column.clone().flatten().collect();
            let levels: Option<Vec<i16>> =
                (k >= columns::ALWAYS).then(|| column.map(|n| i16::from(n.is_some())).collect());
            if let Some(mut to) = rows.next_column()? {
                to.typed::<DoubleType>()
                    .write_batch(&there, levels.as_deref(), None)?;
                to.close()?;
            }
        }
        rows.close()?;
    }
    writer.close()?;
    Ok(())
}

fn schema() -> Result<Arc<Type>> {
    let column = |(k, name): (usize, &str)| {
        let repetition = if k < columns::ALWAYS {
            Repetition::REQUIRED
        } else {
            Repetition::OPTIONAL
        };
        let column = Type::primitive_type_builder(name, Physical::DOUBLE);
        Ok(Arc::new(column.with_repetition(repetition).build()?))
    };
    let all: Result<Vec<_>> = columns::names().enumerate().map(column).collect();
    let path = Type::group_type_builder("path").with_fields(all?);
    Ok(Arc::new(path.build()?))
}
