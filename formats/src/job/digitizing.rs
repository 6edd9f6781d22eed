//! The section on digitizing: what is touched, and how it is searched.

use horma_core::{Contact, Culling, Local, Method, Window};

use super::raw::{Given, RawDigitizing, RawJob};
use super::{CONTACTS, METHODS, Source};
use crate::error::Result;

impl Source<'_> {
    /// Contact and method.
    pub(super) fn digitizing(&self, raw: &RawJob) -> Result<(Contact, Method)> {
        let section = &raw.digitizing;
        let contact = section.contact.as_ref();
        let contact = self.choose(contact, "contact", Contact::Facet, &CONTACTS)?;
        let method = section.method.as_ref();
        let method = self.choose(method, "method", Method::Exact, &METHODS)?;
        let Method::Local(_) = method else {
            // Set by a flag they may stay in the file; they belong to the other method.
            if section.method.as_ref().is_none_or(Given::in_file)
                && let Some((key, at)) = section.only_local().into_iter().find_map(|(k, at)| {
                    let at = at.filter(|at| at.in_file())?;
                    Some((k, at))
                })
            {
                let what = format!("{key} belongs to method = \"local\"");
                return Err(self.wrong(Some(at), what));
            }
            return Ok((contact, method));
        };
        let on = |given: &Option<Given<bool>>, default| given.as_ref().map_or(default, |g| g.value);
        let window = match (&section.delta_u, &section.delta_v) {
            (Some(u), Some(v)) => Some(Window {
                delta_u: self.count(u, "delta_u")?,
                delta_v: self.count(v, "delta_v")?,
            }),
            (None, None) => None,
            (Some(given), None) | (None, Some(given)) => {
                let what = "delta_u and delta_v belong together; without both, the smallest window \
                    that never loses the winner is found";
                return Err(self.wrong(Some(&given.at), what));
            }
        };
        let method = Method::Local(Local {
            window,
            culling: Culling {
                back_faces: on(&section.back_face_culling, false),
                beyond_reach: on(&section.area_of_influence, false),
            },
            fallback: on(&section.fallback, true),
        });
        method.validate(contact).map_err(|e| self.core(raw, e))?;
        Ok((contact, method))
    }

    /// What only one process can do.
    pub(super) fn in_one_process(&self, raw: &RawJob, method: Method, workers: u32) -> Result<()> {
        let Method::Local(local) = method else {
            return Ok(());
        };
        let what = match local {
            _ if workers == 0 => return Ok(()),
            Local {
                fallback: false, ..
            } => "the local search without its fallback is one chain of windows",
            Local { window: None, .. } => {
                "delta_u and delta_v are found by trying them on the whole path"
            }
            Local { .. } => return Ok(()),
        };
        let at = raw.digitizing.method.as_ref().map(|g| &g.at);
        Err(self.wrong(
            at,
            format!("{what}, which takes one process; set workers to 0"),
        ))
    }
}

impl RawDigitizing {
    /// The keys of the local search, and where they are.
    fn only_local(&self) -> [(&'static str, Option<&super::raw::At>); 5] {
        fn at<T>(given: &Option<Given<T>>) -> Option<&super::raw::At> {
            given.as_ref().map(|g| &g.at)
        }
        [
            ("delta_u", at(&self.delta_u)),
            ("delta_v", at(&self.delta_v)),
            ("back_face_culling", at(&self.back_face_culling)),
            ("area_of_influence", at(&self.area_of_influence)),
            ("fallback", at(&self.fallback)),
        ]
    }
}
