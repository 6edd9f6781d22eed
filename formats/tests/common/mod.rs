//! What every reader of parts promises of any bytes, for tests and fuzz targets.

#![allow(dead_code)] // Each fuzz target uses its part of this.

use horma_core::Shape;
use horma_formats::part::{Format, Reading, Trimmed, heal, parse};

/// A reader to try.
pub type Reader = fn(&[u8]);

/// Each of them, by its format's usual extension.
pub const READERS: [(&str, Reader); 6] = [
    ("step", step),
    ("igs", iges),
    ("stl", stl),
    ("obj", obj),
    ("ply", ply),
    ("3mf", threemf),
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
