//! Healing: what exports get wrong with meshes, and can be put right without moving what could be seen.
//!
//! A path does not depend on which way facets face, nor on whether one is there twice. Volumes, pictures
//! and the sections of a last do, so all this is put right and told, in an order that depends on the
//! mesh alone. Holes are left open: what would close them is nobody's design.

use std::collections::{HashMap, HashSet};

use horma_core::{Mesh, Point, cross, dot, length, sub};

use super::Warning;
use crate::error::Result;

/// Farthest that a vertex at an open edge is moved to meet another, mm: a tenth of the usual chordal
/// tolerance, and thirty times what single precision leaves of a last's coordinates.
const CRACK: f64 = 1.0e-3;

/// The same relative to the size of the mesh, for those that are small, or in metres.
const RELATIVE: f64 = 1.0e-5;

/// Heals `mesh` and tells what there was; one without faults keeps every bit.
///
/// # Errors
/// Those of [`Mesh::new`], for nothing that is a mesh already.
pub fn heal(name: &str, mesh: &mut Mesh) -> Result<Vec<Warning>> {
    let mut vertices = mesh.vertices().to_vec();
    let mut triangles = mesh.triangles().to_vec();
    let mut warnings = Vec::new();
    let mut tell = |count: usize, warning: fn(String, usize) -> Warning| {
        if count > 0 {
            warnings.push(warning(name.to_owned(), count));
        }
    };
    let duplicates = join(&mut triangles, &same_places(&vertices));
    tell(duplicates, |name, vertices| Warning::DuplicateVertices {
        name,
        vertices,
    });
    let tolerance = CRACK.min(RELATIVE * size(&vertices));
    let (mut collapsed, mut twice, mut cracks) = (0, 0, 0);
    // A facet that goes may leave an edge open where there is a crack.
    let sides = loop {
        collapsed += drop_collapsed(&mut triangles);
        twice += drop_duplicates(&mut triangles);
        let sides = edges(&triangles);
        let joined = join(&mut triangles, &near_places(&vertices, &sides, tolerance));
        if joined == 0 {
            break sides;
        }
        cracks += joined;
    };
    tell(collapsed, |name, facets| Warning::CollapsedFacets {
        name,
        facets,
    });
    tell(twice, |name, facets| Warning::DuplicateFacets {
        name,
        facets,
    });
    let turned = orient(&vertices, &mut triangles, &sides);
    tell(turned.facets, |name, facets| Warning::FlippedFacets {
        name,
        facets,
    });
    tell(turned.shells, |name, shells| Warning::InsideOut {
        name,
        shells,
    });
    tell(turned.one_sided, |name, shells| Warning::OneSided {
        name,
        shells,
    });
    if cracks > 0 {
        warnings.push(Warning::Cracks {
            name: name.to_owned(),
            vertices: cracks,
            tolerance,
        });
    }
    if triangles != mesh.triangles() {
        compact(&mut vertices, &mut triangles);
        *mesh = Mesh::new(name, vertices, triangles)?;
    }
    Ok(warnings)
}

fn size(vertices: &[Point]) -> f64 {
    let spans = [0, 1, 2].map(|axis| {
        let all = || vertices.iter().map(|v| v[axis]);
        all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
    });
    spans.into_iter().fold(0.0, f64::max)
}

/// For each vertex the first one at its place.
fn same_places(vertices: &[Point]) -> Vec<u32> {
    let mut places = HashMap::with_capacity(vertices.len());
    let numbered = (0_u32..).zip(vertices);
    numbered
        .map(|(i, v)| *places.entry(v.map(|c| (c + 0.0).to_bits())).or_insert(i))
        .collect()
}

/// For each vertex at an open edge the nearest earlier one at another that is within the tolerance, and
/// for each other vertex itself.
fn near_places(vertices: &[Point], edges: &[Edge], tolerance: f64) -> Vec<u32> {
    let mut places: Vec<u32> = (0..vertices.len() as u32).collect();
    let mut open = Vec::new();
    for same in edges.chunk_by(|a, b| a.ends == b.ends) {
        if let [alone] = same {
            open.extend([alone.ends.0, alone.ends.1]);
        }
    }
    open.sort_unstable();
    open.dedup();
    if tolerance <= 0.0 {
        return places;
    }
    let beside = |own: [i64; 3], step: [i64; 3]| {
        std::array::from_fn::<_, 3, _>(|i| own[i].saturating_add(step[i]))
    };
    // Who is within the tolerance is in the same cell or in one beside it.
    let cell = |p: Point| p.map(|c| (c / tolerance).floor() as i64);
    let mut kept: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    for &v in &open {
        let here = vertices[v as usize];
        let own = cell(here);
        let around = (0..27).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]);
        let near = around
            .filter_map(|[i, j, k]| kept.get(&beside(own, [i, j, k])))
            .flatten();
        let near = near.map(|&w| (length(sub(vertices[w as usize], here)), w));
        let near = near.filter(|(distance, _)| *distance <= tolerance);
        match near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))) {
            Some((_, first)) => places[v as usize] = first,
            None => kept.entry(own).or_default().push(v),
        }
    }
    places
}

/// Puts the places of vertices in the place of vertices; how many of these went.
fn join(triangles: &mut [[u32; 3]], places: &[u32]) -> usize {
    let mut gone = HashSet::new();
    for corner in triangles.iter_mut().flatten() {
        let place = places[*corner as usize];
        if place != *corner {
            gone.insert(*corner);
            *corner = place;
        }
    }
    gone.len()
}

/// Drops triangles that have a corner twice where a whole one has that edge, or that corner.
fn drop_collapsed(triangles: &mut Vec<[u32; 3]>) -> usize {
    let is_collapsed = |&[a, b, c]: &[u32; 3]| a == b || b == c || c == a;
    if !triangles.iter().any(is_collapsed) {
        return 0;
    }
    let mut covered = HashSet::new();
    for &[a, b, c] in triangles.iter().filter(|t| !is_collapsed(t)) {
        covered.extend([(a, b), (b, c), (c, a)].map(|(p, q)| (p.min(q), p.max(q))));
        covered.extend([(a, a), (b, b), (c, c)]);
    }
    let before = triangles.len();
    triangles.retain(|t| {
        let (low, high) = (t.iter().min(), t.iter().max());
        let edge = low.copied().zip(high.copied());
        !(is_collapsed(t) && edge.is_some_and(|e| covered.contains(&e)))
    });
    before - triangles.len()
}

/// Drops triangles whose three corners an earlier one has.
fn drop_duplicates(triangles: &mut Vec<[u32; 3]>) -> usize {
    let mut seen = HashSet::with_capacity(triangles.len());
    let before = triangles.len();
    triangles.retain(|t| {
        let mut corners = *t;
        corners.sort_unstable();
        seen.insert(corners)
    });
    before - triangles.len()
}

/// A side of a triangle.
struct Edge {
    /// Its vertices, the lower one first.
    ends: (u32, u32),
    triangle: u32,
    /// Whether the triangle runs from the lower to the higher.
    rises: bool,
}

/// All sides of whole triangles, those between the same vertices beside each other.
fn edges(triangles: &[[u32; 3]]) -> Vec<Edge> {
    let mut edges = Vec::with_capacity(3 * triangles.len());
    for (triangle, &[a, b, c]) in (0_u32..).zip(triangles) {
        if a == b || b == c || c == a {
            continue;
        }
        edges.extend([(a, b), (b, c), (c, a)].map(|(p, q)| Edge {
            ends: (p.min(q), p.max(q)),
            triangle,
            rises: p < q,
        }));
    }
    edges.sort_unstable_by_key(|e| (e.ends, e.triangle));
    edges
}

/// What was turned.
#[derive(Default)]
struct Turned {
    facets: usize,
    shells: usize,
    one_sided: usize,
}

/// Triangles that hang together over edges of exactly two.
struct Shell {
    triangles: Vec<u32>,
    /// Whether each of its edges has two triangles.
    closed: bool,
    /// What it encloses, mm³, negative if it faces inwards.
    volume: f64,
    low: Point,
    high: Point,
}

/// Turns triangles so that those of a shell face the same way, and closed shells outwards; a shell that
/// faces inwards within another may be meant as a cavity, and stays.
fn orient(vertices: &[Point], triangles: &mut [[u32; 3]], edges: &[Edge]) -> Turned {
    let count = triangles.len();
    // For each triangle those beside it, and whether they run along the common edge the same way.
    let mut beside: Vec<[Option<(u32, bool)>; 3]> = vec![[None; 3]; count];
    let mut open = vec![false; count];
    for same in edges.chunk_by(|a, b| a.ends == b.ends) {
        if let [one, two] = same {
            let wrong = one.rises == two.rises;
            for (this, that) in [(one, two), (two, one)] {
                let free = beside[this.triangle as usize]
                    .iter_mut()
                    .find(|b| b.is_none());
                if let Some(free) = free {
                    *free = Some((that.triangle, wrong));
                }
            }
        } else {
            same.iter().for_each(|e| open[e.triangle as usize] = true);
        }
    }
    let mut turned = Turned::default();
    let mut flips: Vec<Option<bool>> = vec![None; count];
    let mut shells = Vec::new();
    for start in 0..count as u32 {
        if flips[start as usize].is_some() || beside[start as usize][0].is_none() {
            continue;
        }
        flips[start as usize] = Some(false);
        let mut members = vec![start];
        let mut consistent = true;
        let mut next = 0;
        while let Some(&this) = members.get(next) {
            next += 1;
            let flip = flips[this as usize] == Some(true);
            for &(that, wrong) in beside[this as usize].iter().flatten() {
                match flips[that as usize] {
                    None => {
                        flips[that as usize] = Some(flip != wrong);
                        members.push(that);
                    }
                    Some(known) => consistent &= known == (flip != wrong),
                }
            }
        }
        if !consistent {
            turned.one_sided += 1;
            continue;
        }
        let flipped = members
            .iter()
            .filter(|&&t| flips[t as usize] == Some(true))
            .count();
        // The many are right, unless a volume says otherwise.
        let invert = 2 * flipped > members.len();
        for &t in &members {
            if (flips[t as usize] == Some(true)) != invert {
                triangles[t as usize].swap(1, 2);
            }
        }
        turned.facets += flipped.min(members.len() - flipped);
        shells.push(shell(vertices, triangles, &open, members));
    }
    let outer: Vec<(Point, Point)> = shells
        .iter()
        .filter(|s| s.closed && s.volume > 0.0)
        .map(|s| (s.low, s.high))
        .collect();
    for shell in shells.iter().filter(|s| s.closed && s.volume < 0.0) {
        let within = |(low, high): &(Point, Point)| {
            (0..3).all(|i| low[i] < shell.low[i] && shell.high[i] < high[i])
        };
        if !outer.iter().any(within) {
            for &t in &shell.triangles {
                triangles[t as usize].swap(1, 2);
            }
            turned.shells += 1;
        }
    }
    turned
}

fn shell(vertices: &[Point], triangles: &[[u32; 3]], open: &[bool], members: Vec<u32>) -> Shell {
    let corners = |t: &u32| triangles[*t as usize].map(|v| vertices[v as usize]);
    let apex = members.first().map(|t| corners(t)[0]).unwrap_or_default();
    let tetrahedra = members.iter().map(|t| {
        let [a, b, c] = corners(t).map(|p| sub(p, apex));
        dot(a, cross(b, c)) / 6.0
    });
    let volume = tetrahedra.sum();
    let points = || members.iter().flat_map(corners);
    let bound = |pick: fn(f64, f64) -> f64| {
        points().fold(apex, |bound, p| {
            std::array::from_fn(|i| pick(bound[i], p[i]))
        })
    };
    Shell {
        closed: !members.iter().any(|&t| open[t as usize]),
        volume,
        low: bound(f64::min),
        high: bound(f64::max),
        triangles: members,
    }
}

/// Keeps only those vertices that triangles name, in their order.
fn compact(vertices: &mut Vec<Point>, triangles: &mut [[u32; 3]]) {
    let mut used = vec![false; vertices.len()];
    triangles
        .iter()
        .flatten()
        .for_each(|&v| used[v as usize] = true);
    let mut numbers = vec![0_u32; vertices.len()];
    let mut count = 0;
    for (number, used) in numbers.iter_mut().zip(&used) {
        *number = count;
        count += u32::from(*used);
    }
    let mut used = used.into_iter();
    vertices.retain(|_| used.next() == Some(true));
    triangles
        .iter_mut()
        .flatten()
        .for_each(|v| *v = numbers[*v as usize]);
}

#[cfg(test)]
mod tests;
