//! The XML of a 3MF package: models, and where the package says that its model is.

use std::collections::HashMap;
use std::io::BufRead;

use horma_core::Point;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::super::Unit;
use super::super::matrix::{IDENTITY, Matrix};

/// A model.
#[derive(Default)]
pub(super) struct Model {
    pub(super) unit: Unit,
    pub(super) objects: HashMap<u32, Object>,
    /// What is built.
    pub(super) items: Vec<Component>,
}

/// A mesh, or what is put together of other objects.
#[derive(Default)]
pub(super) struct Object {
    pub(super) name: String,
    /// Whether it is there only while something is printed.
    pub(super) is_support: bool,
    pub(super) vertices: Vec<Point>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) components: Vec<Component>,
}

/// An object at a place.
#[derive(Clone)]
pub(super) struct Component {
    pub(super) object: u32,
    /// The model that has it, if it is another.
    pub(super) path: Option<String>,
    pub(super) matrix: Matrix,
}

/// Extensions that change no mesh, by how their namespaces end.
const HARMLESS: [&str; 4] = [
    "/production/2015/06",
    "/material/2015/02",
    "/core/2015/02",
    "/trianglesets/2021/07",
];

type Result<T> = std::result::Result<T, String>;

/// Reads a model.
pub(super) fn read(file: impl BufRead) -> Result<Model> {
    let mut model = Model::default();
    // The object that is open, and its number.
    let mut open: Option<(u32, Object)> = None;
    each(file, |event| {
        let (tag, ends) = match event {
            Tag::Begin(tag) => (tag, false),
            Tag::Empty(tag) => (tag, true),
            Tag::End("object") => {
                if let Some((id, object)) = open.take() {
                    model.objects.insert(id, object);
                }
                return Ok(());
            }
            Tag::End(_) => return Ok(()),
        };
        match (tag.local_name().into_inner(), &mut open) {
            ("model", _) => {
                model.unit = unit(tag)?;
                required(tag)?;
            }
            ("object", _) => {
                let id = whole(tag, "id")?;
                let object = Object {
                    name: attribute(tag, "name")?.unwrap_or_default(),
                    is_support: matches!(
                        attribute(tag, "type")?.as_deref(),
                        Some("support" | "solidsupport")
                    ),
                    ..Object::default()
                };
                if ends {
                    model.objects.insert(id, object);
                } else {
                    open = Some((id, object));
                }
            }
            ("vertex", Some((_, object))) => {
                object
                    .vertices
                    .push([number(tag, "x")?, number(tag, "y")?, number(tag, "z")?]);
            }
            ("triangle", Some((_, object))) => {
                let corners = [whole(tag, "v1")?, whole(tag, "v2")?, whole(tag, "v3")?];
                object.triangles.push(corners);
            }
            ("component", Some((_, object))) => object.components.push(component(tag)?),
            ("item", None) => model.items.push(component(tag)?),
            _ => {}
        }
        Ok(())
    })?;
    Ok(model)
}

/// Where the relations of a package say that its model is.
pub(super) fn targets(file: impl BufRead) -> Result<Option<String>> {
    let mut found = None;
    each(file, |event| {
        let (Tag::Begin(tag) | Tag::Empty(tag)) = event else {
            return Ok(());
        };
        let kind = attribute(tag, "Type")?.unwrap_or_default();
        if kind.ends_with("/3dmodel") && found.is_none() {
            found = attribute(tag, "Target")?.as_deref().map(relative);
        }
        Ok(())
    })?;
    Ok(found)
}

enum Tag<'a> {
    Begin(&'a BytesStart<'a>),
    Empty(&'a BytesStart<'a>),
    End(&'a str),
}

/// Hands every tag of a file to `take`, and says of what it refuses where it was.
fn each(file: impl BufRead, mut take: impl FnMut(Tag) -> Result<()>) -> Result<()> {
    let mut reader = Reader::from_reader(file);
    let mut buffer = Vec::new();
    let mut depth = 0_usize;
    let mut any = false;
    loop {
        let event = reader.read_event_into(&mut buffer);
        let event = event.map_err(|e| e.to_string());
        let taken = match event {
            Ok(Event::Start(tag)) => {
                depth += 1;
                any = true;
                take(Tag::Begin(&tag))
            }
            Ok(Event::Empty(tag)) => {
                any = true;
                take(Tag::Empty(&tag))
            }
            Ok(Event::End(tag)) => {
                depth = depth.saturating_sub(1);
                take(Tag::End(tag.local_name().into_inner()))
            }
            Ok(Event::Eof) if depth > 0 => Err("the file is cut short, export it again".to_owned()),
            Ok(Event::Eof) if !any => Err("there is nothing in it".to_owned()),
            Ok(Event::Eof) => return Ok(()),
            Ok(_) => Ok(()),
            Err(e) => Err(e),
        };
        taken.map_err(|e| format!("at byte {}: {e}", reader.buffer_position()))?;
        buffer.clear();
    }
}

/// The attribute with this name, whatever stands before its colon.
fn attribute(tag: &BytesStart, name: &str) -> Result<Option<String>> {
    for attribute in tag.attributes() {
        let attribute = attribute.map_err(|e| e.to_string())?;
        let is_namespace = attribute.key.as_ref().starts_with("xmlns");
        if !is_namespace && attribute.key.local_name().into_inner() == name {
            let value = attribute.normalized_value(quick_xml::XmlVersion::Implicit1_0);
            return Ok(Some(value.map_err(|e| e.to_string())?.into_owned()));
        }
    }
    Ok(None)
}

fn needed<T>(tag: &BytesStart, name: &str, parse: impl Fn(&str) -> Option<T>) -> Result<T> {
    let kind = tag.local_name().into_inner();
    let value = attribute(tag, name)?.ok_or_else(|| format!("a {kind} has no {name}"))?;
    parse(value.trim()).ok_or_else(|| format!("{name} of a {kind} is '{value}'"))
}

fn whole(tag: &BytesStart, name: &str) -> Result<u32> {
    needed(tag, name, |value| value.parse().ok())
}

fn number(tag: &BytesStart, name: &str) -> Result<f64> {
    needed(tag, name, finite)
}

fn finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|n: &f64| n.is_finite())
}

fn component(tag: &BytesStart) -> Result<Component> {
    let matrix = match attribute(tag, "transform")? {
        None => IDENTITY,
        Some(text) => matrix(&text).ok_or_else(|| format!("transform is '{text}'"))?,
    };
    Ok(Component {
        object: whole(tag, "objectid")?,
        path: attribute(tag, "path")?.as_deref().map(relative),
        matrix,
    })
}

/// Twelve numbers: where the three axes go, and then the origin.
fn matrix(text: &str) -> Option<Matrix> {
    let numbers: Option<Vec<f64>> = text.split_ascii_whitespace().map(finite).collect();
    let numbers: [f64; 12] = numbers?.try_into().ok()?;
    let mut matrix = IDENTITY;
    for (column, axis) in numbers.chunks_exact(3).enumerate() {
        for (row, &number) in axis.iter().enumerate() {
            matrix[row][column] = number;
        }
    }
    Some(matrix)
}

/// Names in an archive have no slash in front.
fn relative(path: &str) -> String {
    path.trim_start_matches('/').to_owned()
}

fn unit(tag: &BytesStart) -> Result<Unit> {
    match attribute(tag, "unit")? {
        None => Ok(Unit::default()),
        Some(name) => {
            Unit::named(&name).ok_or_else(|| format!("its unit of length '{name}' is not known"))
        }
    }
}

/// Refuses a model that says of an extension that is not known here that it has to be understood.
fn required(tag: &BytesStart) -> Result<()> {
    let prefixes = attribute(tag, "requiredextensions")?.unwrap_or_default();
    for prefix in prefixes.split_ascii_whitespace() {
        let key = format!("xmlns:{prefix}");
        let mut space = String::new();
        for attribute in tag.attributes() {
            let attribute = attribute.map_err(|e| e.to_string())?;
            if attribute.key.as_ref() == key {
                space = attribute.value.into_owned();
            }
        }
        if !HARMLESS.iter().any(|known| space.ends_with(known)) {
            return Err(format!(
                "it needs the extension {prefix} ({space}), which is not read; export it as a plain mesh"
            ));
        }
    }
    Ok(())
}
