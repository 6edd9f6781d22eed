//! The section on the wheel that cuts.

use horma_core::Cutter;

use super::raw::{Given, RawCutter, RawJob};
use super::source::Source;
use crate::error::Result;

/// The wheels, each with its keys.
const CUTTERS: [(&str, &[&str]); 4] = [
    ("torus", &["major_radius", "minor_radius"]),
    ("ball", &["radius"]),
    ("cylinder", &["radius", "width"]),
    ("cone", &["radius", "width", "half_angle"]),
];

impl Source<'_> {
    pub(super) fn cutter(&self, raw: &RawJob) -> Result<Cutter> {
        let Some(section) = &raw.cutter else {
            let what = "there is no [cutter]; say which wheel cuts, as in kind = \"torus\", \
                major_radius = 40, minor_radius = 8";
            return Err(self.wrong(None, what));
        };
        let cutter = &section.value;
        self.required(section, cutter.kind.as_ref(), "cutter", "kind = \"torus\"")?;
        let (kind, keys) = self.choose(
            cutter.kind.as_ref(),
            "cutter",
            CUTTERS[0],
            &CUTTERS.map(|c| (c.0, c)),
        )?;
        for (key, value) in cutter.dimensions() {
            if let Some(value) = value
                && !keys.contains(&key)
            {
                let keys = keys.join(", ");
                let what = format!("{key} does not belong to a {kind}, which has {keys}");
                return Err(self.wrong(Some(&value.at), what));
            }
        }
        let get = |key: &'static str| self.dimension(section, kind, key);
        let cutter = match kind {
            "torus" => Cutter::torus(get("major_radius")?, get("minor_radius")?),
            "ball" => Cutter::ball(get("radius")?),
            "cylinder" => Cutter::cylinder(get("radius")?, get("width")?),
            _ => Cutter::cone(get("radius")?, get("width")?, get("half_angle")?),
        };
        cutter.map_err(|e| self.core(raw, e))
    }

    fn dimension(&self, section: &Given<RawCutter>, kind: &str, key: &str) -> Result<f64> {
        let mut all = section.value.dimensions().into_iter();
        let value = all.find_map(|(k, v)| v.filter(|_| k == key));
        value.map(|v| v.value).ok_or_else(|| {
            let angle = key == "half_angle";
            let unit = if angle { "degrees" } else { "mm" };
            self.wrong(
                Some(&section.at),
                format!("a {kind} needs {key}, in {unit}"),
            )
        })
    }
}
