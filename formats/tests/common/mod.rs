//! What every reader of files promises of any bytes, for tests and fuzz targets.

#![allow(dead_code)] // Each fuzz target uses its part of this.

use std::path::Path;

use horma_core::Shape;
use horma_formats::csv;
use horma_formats::job::{self, Overrides};
use horma_formats::part::{Format, Reading, Trimmed, heal, parse};

/// A reader to try.
pub type Reader = fn(&[u8]);

/// Each of them, by its format's usual extension.
pub const READERS: [(&str, Reader); 8] = [
    ("step", step),
    ("igs", iges),
    ("stl", stl),
    ("obj", obj),
    ("ply", ply),
    ("3mf", threemf),
    ("toml", job_file),
    ("csv", path),
];

pub fn step(bytes: &[u8]) {
    read(Format::Step, bytes);
}

pub fn iges(bytes: &[u8]) {
    read(Format::Iges, bytes);
}

pub fn stl(bytes: &[u8]) {
    read(Format::Stl, bytes);
}

pub fn obj(bytes: &[u8]) {
    read(Format::Obj, bytes);
}

pub fn ply(bytes: &[u8]) {
    read(Format::Ply, bytes);
}

pub fn threemf(bytes: &[u8]) {
    read(Format::ThreeMf, bytes);
}

/// A job file is refused by its name, or means the same every time.
pub fn job_file(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let parse = || job::parse(&text, Path::new("fuzz"), &Overrides::default());
    match parse() {
        Err(error) => assert!(!error.to_string().is_empty()),
        Ok(found) => {
            let again = parse().expect("as before");
            assert_eq!(found.echo(), again.echo());
            let _ = found.targets();
        }
    }
}

/// A path is refused by the file's name, or has rows that follow each other and numbers that are finite.
pub fn path(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    match csv::parse(&text, Path::new("fuzz")) {
        Err(error) => assert!(error.to_string().contains("fuzz"), "{error}"),
        Ok(rows) => {
            assert!(rows.is_sorted_by(|a, b| a.index < b.index));
            for row in rows {
                let p = row.position();
                assert!(p.x.is_finite() && p.angle.is_finite());
                assert!(p.height.is_none_or(f64::is_finite));
            }
        }
    }
}

/// Bytes are refused by the file's name, or become bodies: some, the same ones every time, and meshes of
/// which nothing is left to heal.
fn read(format: Format, bytes: &[u8]) {
    let reading = Reading {
        unit: None,
        trimmed: Trimmed::Whole,
    };
    let loaded = match parse("fuzz", format, bytes, &reading) {
        Ok(loaded) => loaded,
        Err(error) => {
            assert!(error.to_string().contains("fuzz"), "{error}");
            return;
        }
    };
    assert!(!loaded.bodies.is_empty());
    let again = parse("fuzz", format, bytes, &reading).expect("as before");
    assert_eq!(loaded, again);
    for body in loaded.bodies {
        if let Shape::Mesh(mesh) = body.shape {
            let mut healed = mesh.clone();
            let warnings = heal::heal("fuzz", &mut healed).expect("healed");
            assert_eq!(healed, mesh, "{warnings:?}");
        }
    }
}
