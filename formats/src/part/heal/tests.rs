use super::*;
use horma_core::sub;

/// A box from `low` to `high`, facing outwards.
fn cube(low: f64, high: f64) -> (Vec<Point>, Vec<[u32; 3]>) {
    let at = |i: u32| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { high } else { low });
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = sides
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    ((0..8).map(at).collect(), triangles.collect())
}

fn healed(vertices: Vec<Point>, triangles: Vec<[u32; 3]>) -> (Mesh, Vec<String>) {
    let mut mesh = Mesh::new("m", vertices, triangles).expect("valid");
    let warnings = heal("m", &mut mesh).expect("healed");
    // There is nothing left to heal.
    let mut again = mesh.clone();
    let left = heal("m", &mut again).expect("healed");
    let lasting = |w: &Warning| matches!(w, Warning::OneSided { .. });
    assert!(left.iter().all(lasting), "{left:?}");
    assert_eq!(again, mesh);
    (mesh, warnings.iter().map(ToString::to_string).collect())
}

fn volume(mesh: &Mesh) -> f64 {
    let volumes = mesh.triangles().iter().map(|t| {
        let [a, b, c] = t.map(|v| mesh.vertices()[v as usize]);
        dot(a, cross(b, c)) / 6.0
    });
    (volumes.sum::<f64>() * 1e6).round() / 1e6
}

#[test]
fn a_good_mesh_keeps_every_bit() {
    let (vertices, triangles) = cube(0.0, 10.0);
    let (mesh, warnings) = healed(vertices.clone(), triangles.clone());
    assert_eq!(warnings, Vec::<String>::new());
    assert_eq!(
        (mesh.vertices(), mesh.triangles()),
        (&vertices[..], &triangles[..])
    );
    assert_eq!(volume(&mesh), 1000.0);
}

#[test]
fn triangles_that_face_the_other_way_are_turned() {
    let (vertices, good) = cube(0.0, 10.0);
    for flipped in [
        vec![3],
        vec![0, 5, 11],
        (0..12).collect(),
        (1..12).collect(),
    ] {
        let mut triangles = good.clone();
        flipped
            .iter()
            .for_each(|&t: &usize| triangles[t].swap(1, 2));
        let (mesh, warnings) = healed(vertices.clone(), triangles);
        assert_eq!(volume(&mesh), 1000.0, "{flipped:?}");
        assert_eq!(warnings.is_empty(), flipped.is_empty());
        let told = if flipped.len() == 12 {
            "1 shells are inside out"
        } else {
            "face the other way"
        };
        assert!(warnings[0].contains(told), "{warnings:?}");
    }
    let mut open = good[..9].to_vec();
    open[4].swap(1, 2);
    let (mesh, warnings) = healed(vertices, open);
    assert_eq!(mesh.triangles(), &good[..9]);
    assert_eq!(
        warnings,
        ["m: 1 triangles face the other way than those around them and are turned"]
    );
}

#[test]
fn a_cavity_stays_one() {
    let (mut vertices, mut triangles) = cube(0.0, 10.0);
    let (inner, hole) = cube(2.0, 4.0);
    vertices.extend(inner);
    triangles.extend(hole.iter().map(|&[a, b, c]| [a + 8, c + 8, b + 8]));
    let (mesh, warnings) = healed(vertices.clone(), triangles.clone());
    assert_eq!((volume(&mesh), warnings.len()), (992.0, 0));
    // Beside it there is none.
    vertices[8..].iter_mut().for_each(|v| v[0] += 20.0);
    let (mesh, warnings) = healed(vertices, triangles);
    assert_eq!((volume(&mesh), warnings.len()), (1008.0, 1));
}

#[test]
fn vertices_of_one_place_become_one() {
    let (vertices, triangles) = cube(0.0, 10.0);
    let soup: Vec<Point> = triangles
        .iter()
        .flatten()
        .map(|&v| vertices[v as usize])
        .collect();
    let each = (0..12).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let (mesh, warnings) = healed(soup, each);
    assert_eq!((mesh.vertices().len(), mesh.open_edges().len()), (8, 0));
    assert_eq!(
        warnings,
        ["m: 28 vertices are there more than once and are joined"]
    );
}

#[test]
fn cracks_are_closed_and_gaps_are_not() {
    let (vertices, triangles) = cube(0.0, 10.0);
    let cracked = |gap: f64| {
        // The last side has vertices of its own.
        let mut vertices = vertices.clone();
        let mut triangles = triangles.clone();
        for corner in triangles[10..].iter_mut().flatten() {
            let moved = vertices[*corner as usize].map(|c| c + gap);
            *corner = match vertices[8..].iter().position(|v| *v == moved) {
                Some(known) => known as u32 + 8,
                None => {
                    vertices.push(moved);
                    vertices.len() as u32 - 1
                }
            };
        }
        healed(vertices, triangles)
    };
    let (mesh, warnings) = cracked(1e-5);
    assert_eq!((mesh.vertices().len(), mesh.open_edges().len()), (8, 0));
    assert_eq!(mesh.vertices(), vertices);
    assert_eq!(
        warnings,
        ["m: 4 vertices at open edges are joined to others within 0.000100 mm"]
    );
    let (mesh, warnings) = cracked(0.01);
    assert_eq!((mesh.open_edges().len(), warnings.len()), (8, 0));
}

/// Both edges of the crack are open only once a facet that is there twice has gone.
#[test]
fn a_crack_beside_a_facet_that_is_there_twice_is_closed() {
    let near = 1.0e-5;
    let vertices = vec![
        [0.0; 3],
        [10.0, 0.0, 0.0],
        [0.0, 10.0, 0.0],
        [near, 0.0, 0.0],
        [10.0, near, 0.0],
        [0.0, -10.0, 0.0],
    ];
    let (mesh, warnings) = healed(vertices, vec![[0, 1, 2], [0, 1, 2], [4, 3, 5]]);
    assert_eq!(mesh.triangles(), [[0, 1, 2], [1, 0, 3]]);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
}

#[test]
fn what_is_there_twice_or_without_area_goes_once_it_is_covered() {
    let (vertices, good) = cube(0.0, 10.0);
    let mut triangles = good.clone();
    triangles.extend([
        good[3],
        [good[5][0], good[5][2], good[5][1]],
        [0, 2, 2],
        [7, 7, 7],
    ]);
    let (mesh, warnings) = healed(vertices.clone(), triangles);
    assert_eq!(mesh.triangles(), good);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(
        warnings[0].contains("2 triangles without an area"),
        "{warnings:?}"
    );
    assert!(
        warnings[1].contains("2 triangles are there more than once"),
        "{warnings:?}"
    );
    // An edge that stands alone is there for the cutter.
    let mut vertices = vertices;
    vertices.push([20.0; 3]);
    let lone = [&good[..], &[[0, 8, 8]]].concat();
    let (mesh, warnings) = healed(vertices, lone);
    assert_eq!((mesh.triangles().len(), warnings.len()), (13, 0));
}

#[test]
fn a_strip_with_one_side_stays_as_it_is() {
    // Seven triangles around, joined with a half turn.
    let count = 7_u32;
    let vertices = (0..count).map(|i| {
        let angle = f64::from(i) * std::f64::consts::TAU / f64::from(count);
        [
            angle.cos() * 10.0,
            angle.sin() * 10.0,
            if i % 2 == 0 { 0.0 } else { 3.0 },
        ]
    });
    let triangles: Vec<_> = (0..count)
        .map(|i| [i, (i + 1) % count, (i + 2) % count])
        .collect();
    let vertices: Vec<Point> = vertices.collect();
    assert!(length(sub(vertices[0], vertices[1])) > 1.0);
    let (mesh, warnings) = healed(vertices, triangles.clone());
    assert_eq!(mesh.triangles(), triangles);
    assert_eq!(
        warnings,
        ["m: 1 shells have no inside and no outside; they are machined as they are"]
    );
}
