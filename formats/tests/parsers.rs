//! Parts of every format in `parts/`, a job and a path, made for these tests, and the same files spoilt.

mod common;

use std::path::{Path, PathBuf};

use common::READERS;
use horma_core::Shape;
use horma_formats::part::{Reading, read};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;

fn part(file: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/parts");
    folder.join(file)
}

/// A wedge of 30 × 20 × 10 mm, in every format that has meshes: the same vertices and triangles.
#[test]
fn a_wedge_is_the_same_in_every_format() {
    let wedge = |file: &str| {
        let loaded = read(&part(file), &Reading::default()).expect(file);
        assert_eq!(loaded.warnings, [], "{file}");
        let [body] = &loaded.bodies[..] else {
            panic!("{file} has {} bodies", loaded.bodies.len());
        };
        let Shape::Mesh(mesh) = &body.shape else {
            panic!("{file} has a mesh");
        };
        assert_eq!(mesh.open_edges().len(), 0, "{file}");
        let corner = |v: u32| mesh.vertices()[v as usize];
        mesh.triangles()
            .iter()
            .map(|t| t.map(corner))
            .collect::<Vec<_>>()
    };
    let expected = wedge("wedge.obj");
    assert_eq!(expected.len(), 8);
    for file in [
        "wedge.stl",
        "wedge_binary.stl",
        "wedge.ply",
        "wedge_big.ply",
        "wedge_little.ply",
        "wedge.3mf",
    ] {
        assert_eq!(wedge(file), expected, "{file}");
    }
}

/// The slope of the wedge as a surface, as STEP and as IGES, in inches there.
#[test]
fn a_slope_is_the_same_in_both_formats_of_surfaces() {
    let slope = |file: &str| {
        let loaded = read(&part(file), &Reading::default()).expect(file);
        match &loaded.bodies[0].shape {
            Shape::Surface(surface) => surface.clone(),
            Shape::Mesh(_) => panic!("{file} has a surface"),
        }
    };
    let (step, iges) = (slope("slope.step"), slope("slope.igs"));
    assert_eq!(step.poles()[3], [30.0, 20.0, 0.0]);
    for (p, q) in step.poles().iter().zip(iges.poles()) {
        let apart = horma_core::length(horma_core::sub(*p, *q));
        assert!(apart < 1e-12, "{apart}");
    }
    assert_eq!((step.u(), step.v()), (iges.u(), iges.v()));
}

fn good() -> Vec<Vec<u8>> {
    let folder = part("");
    let entries = std::fs::read_dir(&folder).expect("there");
    let mut paths: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    paths.sort();
    paths
        .iter()
        .map(|p| std::fs::read(p).expect("readable"))
        .collect()
}

/// Some bytes changed, some taken out, and the end cut off.
fn spoilt() -> impl Strategy<Value = Vec<u8>> {
    let places = vec((any::<Index>(), any::<u8>()), 0..6);
    let gap = (any::<Index>(), 0..20_usize);
    (prop::sample::select(good()), places, gap, 0.3..1.0_f64).prop_map(
        |(mut bytes, places, (start, length), share)| {
            for (place, byte) in places {
                let place = place.index(bytes.len());
                bytes[place] = byte;
            }
            let start = start.index(bytes.len());
            bytes.drain(start..(start + length).min(bytes.len()));
            // Half of them keep their ends.
            let kept = bytes.len() as f64 * (share + 0.35).min(1.0);
            bytes.truncate(kept as usize);
            bytes
        },
    )
}

proptest! {
    #[test]
    fn arbitrary_bytes_never_panic_a_reader(bytes in vec(any::<u8>(), 0..400)) {
        for (_, read) in READERS {
            read(&bytes);
        }
    }

    /// Files that are nearly right get further than noise.
    #[test]
    fn spoilt_files_never_panic_a_reader(bytes in spoilt()) {
        for (_, read) in READERS {
            read(&bytes);
        }
    }
}
