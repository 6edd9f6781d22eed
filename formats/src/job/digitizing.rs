//! The section on digitizing: what is touched, and how it is searched.

use horma_core::{Contact, Culling, Local, Method, Window};

use super::raw::{Given, RawDigitizing, RawJob};
use super::source::Source;
use crate::error::Result;

pub(super) const CONTACTS: [(&str, Contact); 2] =
    [("facet", Contact::Facet), ("point", Contact::Point)];
const METHODS: [(&str, Method); 3] = [
    ("exact", Method::Exact),
    ("brute", Method::Brute),
    ("local", Method::Local(LOCAL)),
];
/// The local search of a job that says no more.
const LOCAL: Local = Local {
    window: None,
    culling: Culling {
        back_faces: false,
        beyond_reach: false,
    },
    fallback: true,
};

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
            let mut given = section.only_local().into_iter();
            let given = given.find_map(|(key, at)| Some((key, at.filter(|at| at.in_file())?)));
            if section.method.as_ref().is_none_or(Given::in_file)
                && let Some((key, at)) = given
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
        match method {
            Method::Local(local) if workers > 0 && local.needs_whole_path() => {
                let what = "without its fallback, or without delta_u and delta_v, the local search \
                    goes over the whole path in one process; set workers to 0";
                Err(self.wrong(raw.digitizing.method.as_ref().map(|g| &g.at), what))
            }
            Method::Exact | Method::Brute | Method::Local(_) => Ok(()),
        }
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
