//! Units of length: what files and jobs call them, and how many millimetres they have.

/// A unit of length.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Its name, in lower case.
    pub name: String,
    /// How many millimetres it has.
    pub millimetres: f64,
}

/// Each unit with its millimetres, first by the name by which it is told.
const UNITS: [(f64, &[&str]); 10] = [
    (
        1.0,
        &[
            "millimetre",
            "mm",
            "millimeter",
            "millimetres",
            "millimeters",
        ],
    ),
    (
        10.0,
        &[
            "centimetre",
            "cm",
            "centimeter",
            "centimetres",
            "centimeters",
        ],
    ),
    (1000.0, &["metre", "m", "meter", "metres", "meters"]),
    (
        1.0e6,
        &["kilometre", "km", "kilometer", "kilometres", "kilometers"],
    ),
    (
        0.001,
        &["micrometre", "um", "micron", "micrometer", "microns", "µm"],
    ),
    (25.4, &["inch", "in", "inches"]),
    (304.8, &["foot", "ft", "feet"]),
    (0.0254, &["mil", "mils", "thou"]),
    (25.4e-6, &["microinch", "uin", "microinches"]),
    (1_609_344.0, &["mile", "mi", "miles"]),
];

/// What a job may call a unit, for messages.
pub const NAMES: &str = "mm, cm, m, um, inch, ft, mil";

impl Unit {
    /// The unit that is called `name`, in either case.
    pub fn named(name: &str) -> Option<Self> {
        let name = name.trim().to_lowercase();
        let known = UNITS.iter().find(|(_, names)| names.contains(&&*name));
        known.map(|&(millimetres, names)| Self {
            name: names[0].to_owned(),
            millimetres,
        })
    }
}

impl Default for Unit {
    /// A millimetre.
    fn default() -> Self {
        Self {
            name: UNITS[0].1[0].to_owned(),
            millimetres: 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_many_names_and_one_size() {
        for (name, millimetres) in [("MM", 1.0), ("Inch", 25.4), (" m ", 1000.0), ("FT", 304.8)] {
            let unit = Unit::named(name).expect(name);
            assert_eq!(unit.millimetres, millimetres, "{name}");
        }
        assert_eq!(Unit::named("mm"), Some(Unit::default()));
        assert_eq!(Unit::named("furlong"), None);
        for name in NAMES.split(", ") {
            assert!(Unit::named(name).is_some(), "{name}");
        }
    }
}
