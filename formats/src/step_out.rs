//! STEP out: B-spline surfaces, each whole and with its name, in a file for other CAD programs.
//!
//! ISO 10303-21 in the schema of AP214, millimetres; every surface is a face of a shell of its own,
//! bounded by its natural boundary. The same surfaces make the same bytes: the header has no date.
//! Solids, assemblies and colours are not written.

use std::fmt::{Display, Write};

use horma_core::{Direction, Point, Surface};

/// A STEP file called `name` of `surfaces` with their names.
pub fn write(name: &str, surfaces: &[(&str, &Surface)]) -> String {
    let mut data = Data::default();
    let origin = data.point([0.0; 3]);
    let up = data.add("DIRECTION('',(0.,0.,1.))");
    let ahead = data.add("DIRECTION('',(1.,0.,0.))");
    let frame = data.add(format_args!("AXIS2_PLACEMENT_3D('',{origin},{up},{ahead})"));
    let mut items = vec![frame];
    for (name, surface) in surfaces {
        let name = quoted(name);
        let face = data.face(&name, surface);
        let shell = data.add(format_args!("OPEN_SHELL({name},({face}))"));
        items.push(data.add(format_args!("SHELL_BASED_SURFACE_MODEL({name},({shell}))")));
    }
    data.product(name, &items);
    format!(
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n\
         FILE_NAME({},'',(''),(''),'horma','horma','');\n\
         FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));\nENDSEC;\n\
         DATA;\n{}ENDSEC;\nEND-ISO-10303-21;\n",
        quoted(name),
        data.text
    )
}

/// The data section as far as it is written.
#[derive(Default)]
struct Data {
    text: String,
    entities: usize,
}

/// Number of an entity in the file.
#[derive(Clone, Copy, PartialEq)]
struct Id(usize);

impl Display for Id {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "#{}", self.0)
    }
}

/// One side of a face.
#[derive(Clone, PartialEq)]
struct Side {
    poles: Vec<Point>,
    weights: Option<Vec<f64>>,
}

impl Data {
    fn add(&mut self, entity: impl Display) -> Id {
        self.entities += 1;
        let id = Id(self.entities);
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "{id}={entity};");
        id
    }

    fn point(&mut self, p: Point) -> Id {
        self.add(format_args!("CARTESIAN_POINT('',{})", reals(&p)))
    }

    fn points(&mut self, points: &[Point]) -> String {
        let ids: Vec<Id> = points.iter().map(|&p| self.point(p)).collect();
        list(&ids)
    }

    /// The face that is all of `surface`. Sides that coincide are one edge, used twice: a seam. A
    /// side that is collapsed to a point is no edge.
    fn face(&mut self, name: &str, surface: &Surface) -> Id {
        let (m, n) = (surface.u().count(), surface.v().count());
        let side = |indices: &dyn Fn(usize) -> usize, count: usize| Side {
            poles: (0..count).map(|k| surface.poles()[indices(k)]).collect(),
            weights: surface
                .weights()
                .map(|w| (0..count).map(|k| w[indices(k)]).collect()),
        };
        // Around the domain: v first, u last, v last, u first; the latter two run backwards.
        let sides = [
            (side(&|k| k * n, m), surface.u(), true),
            (side(&|k| (m - 1) * n + k, n), surface.v(), true),
            (side(&|k| k * n + n - 1, m), surface.u(), false),
            (side(&|k| k, n), surface.v(), false),
        ];
        let mut vertices: Vec<(Point, Id)> = Vec::new();
        let mut edges: Vec<(&Side, Id)> = Vec::new();
        let mut uses = Vec::new();
        for (side, direction, forwards) in &sides {
            if side.poles.iter().all(|p| *p == side.poles[0]) {
                continue;
            }
            let edge = match edges.iter().find(|(s, _)| *s == side) {
                Some(&(_, edge)) => edge,
                None => self.edge(side, direction, &mut vertices),
            };
            edges.push((side, edge));
            let sense = logical(*forwards);
            uses.push(self.add(format_args!("ORIENTED_EDGE('',*,*,{edge},{sense})")));
        }
        let edge_loop = self.add(format_args!("EDGE_LOOP('',{})", list(&uses)));
        let bound = self.add(format_args!("FACE_OUTER_BOUND('',{edge_loop},.T.)"));
        let geometry = self.surface(name, surface);
        self.add(format_args!(
            "ADVANCED_FACE({name},({bound}),{geometry},.T.)"
        ))
    }

    fn edge(&mut self, side: &Side, along: &Direction, vertices: &mut Vec<(Point, Id)>) -> Id {
        let mut vertex = |data: &mut Self, p: Point| {
            if let Some(&(_, id)) = vertices.iter().find(|(q, _)| *q == p) {
                return id;
            }
            let point = data.point(p);
            let id = data.add(format_args!("VERTEX_POINT('',{point})"));
            vertices.push((p, id));
            id
        };
        let start = vertex(self, side.poles[0]);
        let end = vertex(self, side.poles[side.poles.len() - 1]);
        let poles = self.points(&side.poles);
        let (multiplicities, knots) = multiplicities(along);
        let closed = logical(start == end);
        let shape = format!("{},{poles},.UNSPECIFIED.,{closed},.F.", along.degree);
        let knots = format!("{multiplicities},{knots},.UNSPECIFIED.");
        let curve = match &side.weights {
            None => self.add(format_args!("B_SPLINE_CURVE_WITH_KNOTS('',{shape},{knots})")),
            Some(weights) => self.add(format_args!(
                "(BOUNDED_CURVE()B_SPLINE_CURVE({shape})B_SPLINE_CURVE_WITH_KNOTS({knots})CURVE()\
                 GEOMETRIC_REPRESENTATION_ITEM()RATIONAL_B_SPLINE_CURVE({})REPRESENTATION_ITEM(''))",
                reals(weights)
            )),
        };
        self.add(format_args!("EDGE_CURVE('',{start},{end},{curve},.T.)"))
    }

    fn surface(&mut self, name: &str, surface: &Surface) -> Id {
        let (u, v) = (surface.u(), surface.v());
        let rows = surface.poles().chunks_exact(v.count());
        let rows: Vec<String> = rows.map(|row| self.points(row)).collect();
        let ((u_many, u_knots), (v_many, v_knots)) = (multiplicities(u), multiplicities(v));
        let shape = format!(
            "{},{},{},.UNSPECIFIED.,.U.,.U.,.U.",
            u.degree,
            v.degree,
            list(&rows)
        );
        let knots = format!("{u_many},{v_many},{u_knots},{v_knots},.UNSPECIFIED.");
        match surface.weights() {
            None => self.add(format_args!(
                "B_SPLINE_SURFACE_WITH_KNOTS({name},{shape},{knots})"
            )),
            Some(weights) => {
                let weights: Vec<String> = weights.chunks_exact(v.count()).map(reals).collect();
                self.add(format_args!(
                    "(BOUNDED_SURFACE()B_SPLINE_SURFACE({shape})B_SPLINE_SURFACE_WITH_KNOTS({knots})\
                     GEOMETRIC_REPRESENTATION_ITEM()RATIONAL_B_SPLINE_SURFACE({})\
                     REPRESENTATION_ITEM({name})SURFACE())",
                    list(&weights)
                ))
            }
        }
    }

    /// The product that the schema wants around a shape, and its units.
    fn product(&mut self, name: &str, items: &[Id]) {
        let name = quoted(name);
        let application =
            self.add("APPLICATION_CONTEXT('core data for automotive mechanical design processes')");
        self.add(format_args!(
            "APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,{application})"
        ));
        let context = self.add(format_args!(
            "PRODUCT_CONTEXT('',{application},'mechanical')"
        ));
        let product = self.add(format_args!("PRODUCT({name},{name},'',({context}))"));
        self.add(format_args!(
            "PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({product}))"
        ));
        let version = self.add(format_args!(
            "PRODUCT_DEFINITION_FORMATION('','',{product})"
        ));
        let stage = self.add(format_args!(
            "PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')"
        ));
        let definition = self.add(format_args!(
            "PRODUCT_DEFINITION('design','',{version},{stage})"
        ));
        let shape = self.add(format_args!("PRODUCT_DEFINITION_SHAPE('','',{definition})"));
        let length = self.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))");
        let angle = self.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
        let solid = self.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())");
        let precision = self.add(format_args!(
            "UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-6),{length},'distance_accuracy_value','')"
        ));
        let space = self.add(format_args!(
            "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({precision}))\
             GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid}))REPRESENTATION_CONTEXT('','3D'))"
        ));
        let representation = self.add(format_args!(
            "MANIFOLD_SURFACE_SHAPE_REPRESENTATION({name},{},{space})",
            list(items)
        ));
        self.add(format_args!(
            "SHAPE_DEFINITION_REPRESENTATION({shape},{representation})"
        ));
    }
}

/// Multiplicities and knots, each knot once.
fn multiplicities(direction: &Direction) -> (String, String) {
    let runs = direction.knots.chunk_by(|a, b| a == b);
    let (many, knots): (Vec<usize>, Vec<f64>) = runs.map(|r| (r.len(), r[0])).unzip();
    (list(&many), reals(&knots))
}

fn list<T: Display>(items: &[T]) -> String {
    let mut text = String::from("(");
    for (i, item) in items.iter().enumerate() {
        // Lines stay short enough for editors, and for readers with a buffer.
        let line = text.len() - text.rfind('\n').map_or(0, |end| end + 1);
        let separator = match i {
            0 => "",
            _ if line > 72 => ",\n",
            _ => ",",
        };
        let _ = write!(text, "{separator}{item}");
    }
    text + ")"
}

fn reals(values: &[f64]) -> String {
    let reals: Vec<String> = values.iter().map(|&v| real(v)).collect();
    list(&reals)
}

/// The shortest decimal that reads back as the same number; a STEP real has a point.
fn real(value: f64) -> String {
    let digits = format!("{}", value + 0.0);
    if digits.contains('.') {
        digits
    } else {
        digits + "."
    }
}

fn logical(value: bool) -> &'static str {
    if value { ".T." } else { ".F." }
}

/// A string literal: apostrophes and backslashes doubled, what is not ASCII as UTF-16.
fn quoted(text: &str) -> String {
    let mut literal = String::from("'");
    for c in text.chars() {
        match c {
            '\'' => literal.push_str("''"),
            '\\' => literal.push_str("\\\\"),
            ' '..='~' => literal.push(c),
            _ => {
                literal.push_str("\\X2\\");
                for unit in c.encode_utf16(&mut [0; 2]) {
                    let _ = write!(literal, "{unit:04X}");
                }
                literal.push_str("\\X0\\");
            }
        }
    }
    literal + "'"
}

#[cfg(test)]
mod tests;
