use super::*;

/// A square of two triangles and one of four corners, with a colour that nobody needs.
fn ascii() -> String {
    "ply\nformat ascii 1.0\ncomment a test\nelement vertex 4\nproperty float x\nproperty float y\n\
     property double z\nproperty uchar red\nelement face 2\nproperty list uchar int vertex_indices\n\
     element note 1\nproperty int what\nend_header\n\
     0 0 0.5 255\n1 0 0.5 0\n1 1 0.5 0\n0 1 0.5 0\n3 0 1 2\n4 0 1 2 3\n7\n"
        .to_owned()
}

/// The same in binary.
fn binary(big: bool) -> Vec<u8> {
    let format = if big {
        "binary_big_endian"
    } else {
        "binary_little_endian"
    };
    let text = ascii().replace("format ascii", &format!("format {format}"));
    let end = text.find("end_header\n").expect("there") + "end_header\n".len();
    let mut bytes = text.as_bytes()[..end].to_vec();
    let order = |mut number: Vec<u8>| {
        if big {
            number.reverse();
        }
        number
    };
    for [x, y] in [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
        for number in [x, y] {
            bytes.extend(order(number.to_le_bytes().to_vec()));
        }
        bytes.extend(order(0.5_f64.to_le_bytes().to_vec()));
        bytes.push(9);
    }
    for face in [&[0_i32, 1, 2][..], &[0, 1, 2, 3]] {
        bytes.push(face.len() as u8);
        for corner in face {
            bytes.extend(order(corner.to_le_bytes().to_vec()));
        }
    }
    bytes.extend(order(7_i32.to_le_bytes().to_vec()));
    bytes
}

fn mesh(bytes: &[u8]) -> Mesh {
    let read = parse("t.ply", bytes, &Reading::default()).expect("valid");
    match read.bodies.into_iter().next().expect("one").shape {
        Shape::Mesh(mesh) => mesh,
        Shape::Surface(_) => unreachable!("PLY has meshes only"),
    }
}

#[track_caller]
fn refused(text: &str, expected: &str) {
    let error = parse("t.ply", text.as_bytes(), &Reading::default());
    let error = error.expect_err(expected).to_string();
    assert!(
        error.starts_with("t.ply") && error.contains(expected),
        "{error}"
    );
}

#[test]
fn all_encodings_give_the_same_mesh() {
    let expected = mesh(ascii().as_bytes());
    assert_eq!(expected.vertices()[2], [1.0, 1.0, 0.5]);
    assert_eq!(expected.triangles(), [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh(&binary(false)), expected);
    assert_eq!(mesh(&binary(true)), expected);
    assert_eq!(mesh(ascii().replace('\n', "\r\n").as_bytes()), expected);
    let old = ascii().replace("vertex_indices", "vertex_index");
    assert_eq!(mesh(old.as_bytes()), expected);
}

#[test]
fn points_are_refused_with_what_to_do() {
    let header = ascii().replace("element face 2", "element face 0");
    let points = header.replace("3 0 1 2\n4 0 1 2 3\n", "");
    refused(&points, "Screened Poisson");
}

#[test]
fn what_is_wrong_is_told_by_line_or_by_face() {
    refused(&ascii().replace("1 1 0.5 0", "1 1"), "line 16");
    refused(&ascii().replace("3 0 1 2", "3 0 1 9"), "vertex 9");
    refused(&ascii().replace("3 0 1 2", "3 0 1 -1"), "triangle 0");
    refused(&ascii().replace("3 0 1 2", "2 0 1"), "face 0 has 2 corners");
    refused(&ascii().replace("3 0 1 2", "0"), "face 0 has 0 corners");
    refused(&ascii().replace("0 0 0.5", "nan 0 0.5"), "line 14");
    refused(&ascii().replace("property float x\n", ""), "x, y and z");
    refused(
        &ascii().replace("vertex_indices", "other"),
        "vertex_indices",
    );
    refused(
        &ascii().replace("element vertex 4", "element vertex 999999"),
        "more than there are",
    );
    refused(&ascii().replace("vertex 4", "vertex 6"), "line");
    refused(
        "ply\nformat ascii 1.0\nelement x 5\nend_header\n",
        "more than there are",
    );
    refused("ply\nformat ascii 1.0\nend_header\n", "no triangle");
    refused("ply\nrubbish\n", "line");
    let cut = binary(false);
    let error = parse("t.ply", &cut[..cut.len() - 20], &Reading::default());
    assert!(error.expect_err("cut").to_string().contains("end of file"));
}
