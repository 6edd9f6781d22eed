//! `scene.glb`: the part, the machined surface with its errors in colour, and the path, for viewers; glTF 2.0 in one
//! binary file.
//!
//! glTF counts in metres and has Y up: coordinates are the part's in mm, Y along the attack axis, and the node
//! above them all makes metres of them.

use std::io::{self, Write};

use horma_core::{Machined, Point, Waypoint};
use serde_json::{Value, json};

use crate::map::Scale;
use crate::preview::{CENTRE, CONTACT, Colour, Sheet, centre};
use crate::skin::{Which, skin};

/// What is shown.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene<'a> {
    pub part: &'a [Sheet],
    pub machined: &'a Machined,
    pub path: &'a [Waypoint],
}

/// Colour of the part, and of what brings its own.
const PART: Colour = [222, 184, 135];
const WHITE: Colour = [255; 3];

/// The format's numbers for kinds of values, of buffers and of figures.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY: u32 = 34962;
const ELEMENT_ARRAY: u32 = 34963;
const LINES: u32 = 1;
const TRIANGLES: u32 = 4;

/// Writes a scene.
pub(crate) fn write(scene: &Scene, out: &mut impl Write) -> io::Result<()> {
    let mut file = Gltf::default();
    let surface = material("part", PART);
    for sheet in scene.part.iter().filter(|s| !s.triangles.is_empty()) {
        let mut figure = file.figure("part", surface.clone());
        figure.points("POSITION", &sheet.points);
        if !sheet.normals.is_empty() {
            // Where there is none any will do; the spindle's ends are where sides collapse into points.
            let normal = |n: &Point| if *n == [0.0; 3] { [1.0, 0.0, 0.0] } else { *n };
            let normals: Vec<Point> = sheet.normals.iter().map(normal).collect();
            figure.points("NORMAL", &normals);
        }
        figure.end(TRIANGLES, sheet.triangles.as_flattened());
    }
    let left = skin(scene.machined, Which::Machined);
    if !left.triangles.is_empty() {
        let scale = Scale::of(scene.machined);
        let colours = left.deviations.iter().map(|d| linear(scale.colour(*d)));
        let mut figure = file.figure("machined", material("machined", WHITE));
        figure.points("POSITION", &left.points);
        figure.points("COLOR_0", &colours.collect::<Vec<_>>());
        figure.end(TRIANGLES, left.triangles.as_flattened());
    }
    let contacts = scene.path.iter().map(|w| w.touch.map(|t| t.contact));
    file.line("contacts", CONTACT, contacts);
    file.line("tool centres", CENTRE, scene.path.iter().map(centre));
    file.write(out)
}

fn material(name: &str, colour: Colour) -> Value {
    let [red, green, blue] = linear(colour);
    json!({
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [red, green, blue, 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.9,
        },
        // Surfaces and meshes may be open, and say nothing of their sides.
        "doubleSided": true,
    })
}

/// A colour as light, in shares: what the format reckons in.
fn linear(colour: Colour) -> Point {
    colour.map(|level| {
        let share = f64::from(level) / 255.0;
        if share <= 0.04045 {
            share / 12.92
        } else {
            libm::pow((share + 0.055) / 1.055, 2.4)
        }
    })
}

/// A file on its way: what is in it, and its numbers.
#[derive(Default)]
struct Gltf {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    numbers: Vec<u8>,
}

/// A figure on its way into a file.
struct Figure<'a> {
    file: &'a mut Gltf,
    name: &'static str,
    attributes: serde_json::Map<String, Value>,
}

impl Gltf {
    /// Begins a figure of a material.
    fn figure(&mut self, name: &'static str, material: Value) -> Figure<'_> {
        self.materials.push(material);
        Figure {
            file: self,
            name,
            attributes: serde_json::Map::new(),
        }
    }

    /// A line that is interrupted at each `None`.
    fn line(
        &mut self,
        name: &'static str,
        colour: Colour,
        points: impl Iterator<Item = Option<Point>>,
    ) {
        let (mut there, mut joined) = (Vec::new(), Vec::new());
        let mut before = false;
        for point in points {
            if let Some(point) = point {
                let number = there.len() as u32;
                if before {
                    joined.extend([number - 1, number]);
                }
                there.push(point);
            }
            before = point.is_some();
        }
        if joined.is_empty() {
            return;
        }
        let mut figure = self.figure(name, material(name, colour));
        figure.points("POSITION", &there);
        figure.end(LINES, &joined);
    }

    /// Adds numbers; the place of what tells of them.
    fn add(&mut self, target: u32, bytes: impl Iterator<Item = [u8; 4]>, mut of: Value) -> usize {
        let begin = self.numbers.len();
        self.numbers.extend(bytes.flatten());
        of["bufferView"] = json!(self.views.len());
        self.views.push(json!({
            "buffer": 0,
            "byteOffset": begin,
            "byteLength": self.numbers.len() - begin,
            "target": target,
        }));
        self.accessors.push(of);
        self.accessors.len() - 1
    }

    fn write(mut self, out: &mut impl Write) -> io::Result<()> {
        let all: Vec<usize> = (0..self.nodes.len()).collect();
        self.nodes
            .push(json!({ "name": "mm", "scale": [0.001, 0.001, 0.001], "children": all }));
        let text = json!({
            "asset": { "version": "2.0", "generator": concat!("horma ", env!("CARGO_PKG_VERSION")) },
            "scene": 0,
            "scenes": [{ "nodes": [all.len()] }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.numbers.len() }],
        });
        let mut text = serde_json::to_vec(&text)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        let whole = 12 + 8 + text.len() + 8 + self.numbers.len();
        let length = |bytes: usize| {
            let too_long = "it would be longer than the 4 GiB that glTF can count; leave it out";
            u32::try_from(bytes).map_err(|_| io::Error::other(too_long))
        };
        out.write_all(b"glTF")?;
        out.write_all(&2_u32.to_le_bytes())?;
        out.write_all(&length(whole)?.to_le_bytes())?;
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.numbers)] {
            out.write_all(&length(chunk.len())?.to_le_bytes())?;
            out.write_all(kind)?;
            out.write_all(chunk)?;
        }
        Ok(())
    }
}

impl Figure<'_> {
    /// Gives each corner three numbers.
    fn points(&mut self, attribute: &str, points: &[Point]) {
        let singles = points.iter().map(|p| p.map(|c| c as f32));
        let mut of = json!({ "componentType": FLOAT, "type": "VEC3", "count": points.len() });
        if attribute == "POSITION" {
            let bound = |first: f32, of: fn(f32, f32) -> f32| {
                let folded = singles.clone();
                folded.fold([first; 3], |a, b| std::array::from_fn(|k| of(a[k], b[k])))
            };
            of["min"] = json!(bound(f32::INFINITY, f32::min));
            of["max"] = json!(bound(f32::NEG_INFINITY, f32::max));
        }
        let bytes = singles.flatten().map(f32::to_le_bytes);
        let number = self.file.add(ARRAY, bytes, of);
        self.attributes.insert(attribute.to_owned(), json!(number));
    }

    /// Joins the corners to triangles or lines.
    fn end(self, mode: u32, corners: &[u32]) {
        let Self {
            file,
            name,
            attributes,
        } = self;
        let of = json!({ "componentType": UNSIGNED_INT, "type": "SCALAR", "count": corners.len() });
        let bytes = corners.iter().map(|c| c.to_le_bytes());
        let indices = file.add(ELEMENT_ARRAY, bytes, of);
        let material = file.materials.len() - 1;
        let figure = json!({
            "attributes": attributes,
            "indices": indices,
            "mode": mode,
            "material": material,
        });
        file.nodes
            .push(json!({ "name": name, "mesh": file.meshes.len() }));
        file.meshes
            .push(json!({ "name": name, "primitives": [figure] }));
    }
}

#[cfg(test)]
mod tests {
    use horma_core::{Index, Touch};

    use super::*;
    use crate::map::tests::surface;

    /// The chunks of a file.
    fn parts(file: &[u8]) -> (Value, &[u8]) {
        let word =
            |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().expect("four")) as usize;
        assert_eq!(&file[..4], b"glTF");
        assert_eq!((word(4), word(8)), (2, file.len()));
        let text = word(12);
        assert_eq!((&file[16..20], text % 4), (&b"JSON"[..], 0));
        let rest = 20 + text;
        assert_eq!(&file[rest + 4..rest + 8], b"BIN\0");
        assert_eq!(word(rest), file.len() - rest - 8);
        (
            serde_json::from_slice(&file[20..rest]).expect("JSON"),
            &file[rest + 8..],
        )
    }

    #[test]
    fn a_scene_holds_part_surface_and_path() {
        let sheet = Sheet {
            points: vec![[0.0; 3], [10.0, 0.0, 0.0], [10.0, 0.0, 8.0]],
            normals: vec![[0.0; 3]; 3],
            triangles: vec![[0, 1, 2]],
        };
        let at = |i: u64| Waypoint {
            index: Index::whole(i),
            x: 1.0,
            angle: 90.0 * i as f64,
            touch: (i != 2).then_some(Touch {
                height: 20.0,
                contact: [i as f64, 1.0, 2.0],
            }),
        };
        let scene = Scene {
            part: &[sheet],
            machined: &surface(),
            path: &(0..5).map(at).collect::<Vec<_>>(),
        };
        let mut file = Vec::new();
        write(&scene, &mut file).expect("memory");
        let (text, numbers) = parts(&file);
        let names: Vec<&str> = text["nodes"]
            .as_array()
            .expect("nodes")
            .iter()
            .filter_map(|n| n["name"].as_str())
            .collect();
        assert_eq!(
            names,
            ["part", "machined", "contacts", "tool centres", "mm"]
        );
        // Positions 0, 1 and 3, 4 are joined.
        let contacts = &text["meshes"][2]["primitives"][0];
        assert_eq!(contacts["mode"], 1);
        let accessor = &text["accessors"][contacts["indices"].as_u64().expect("one") as usize];
        assert_eq!(accessor["count"], 4);
        let view = &text["bufferViews"][accessor["bufferView"].as_u64().expect("one") as usize];
        let begin = view["byteOffset"].as_u64().expect("one") as usize;
        let joined: Vec<u32> = numbers[begin..begin + 16]
            .as_chunks()
            .0
            .iter()
            .map(|b| u32::from_le_bytes(*b))
            .collect();
        assert_eq!(joined, [0, 1, 2, 3]);
        let places =
            &text["accessors"][contacts["attributes"]["POSITION"].as_u64().expect("one") as usize];
        assert_eq!(places["max"], json!([4.0, 1.0, 2.0]));
        // Red where it is gouged, in light.
        let colours = &text["meshes"][1]["primitives"][0]["attributes"]["COLOR_0"];
        let view = &text["accessors"][colours.as_u64().expect("one") as usize]["bufferView"];
        let begin =
            text["bufferViews"][view.as_u64().expect("one") as usize]["byteOffset"].as_u64();
        let gouged = begin.expect("one") as usize + 9 * 12;
        let red = f32::from_le_bytes(numbers[gouged..gouged + 4].try_into().expect("four"));
        assert!((red - 0.527).abs() < 0.001, "{red}");
    }

    #[test]
    fn a_path_without_contact_has_no_line() {
        let scene = Scene {
            part: &[],
            machined: &surface(),
            path: &[],
        };
        let mut file = Vec::new();
        write(&scene, &mut file).expect("memory");
        let (text, _) = parts(&file);
        assert_eq!(text["nodes"].as_array().map(Vec::len), Some(2));
    }
}
