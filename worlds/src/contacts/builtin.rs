//! The contact plans and traces that are built in: small examples, one for each format.

/// A contact plan or trace that is built in.
///
/// ```
/// use farside_worlds::contacts::{Builtin, ContactFormat, ContactPlan};
/// let file = Builtin::find("mars-relay").unwrap();
/// let format = ContactFormat::guess(file.file_name, file.bytes);
/// assert_eq!(ContactPlan::from_bytes(file.bytes, format)?.nodes().count(), 3);
/// # Ok::<(), farside_worlds::contacts::ContactError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Builtin {
    /// The name that scenarios give.
    pub name: &'static str,
    /// The file's name; its ending tells the format.
    pub file_name: &'static str,
    /// What the file holds.
    pub bytes: &'static [u8],
}

const PLANS: [Builtin; 2] = [
    Builtin {
        name: "lunar-relay",
        file_name: "lunar-relay.json",
        bytes: include_bytes!("../../data/contacts/lunar-relay.json"),
    },
    Builtin {
        name: "mars-relay",
        file_name: "mars-relay.ionrc",
        bytes: include_bytes!("../../data/contacts/mars-relay.ionrc"),
    },
];

const TRACES: [Builtin; 1] = [Builtin {
    name: "rover-radio",
    file_name: "rover-radio.down",
    bytes: include_bytes!("../../data/contacts/rover-radio.down"),
}];

impl Builtin {
    /// The contact plan called `name`.
    pub fn find(name: &str) -> Option<Builtin> {
        PLANS.into_iter().find(|file| file.name == name)
    }

    /// The capacity trace called `name`.
    pub fn find_trace(name: &str) -> Option<Builtin> {
        TRACES.into_iter().find(|file| file.name == name)
    }

    /// The names of the contact plans, sorted.
    pub fn plan_names() -> impl Iterator<Item = &'static str> {
        PLANS.into_iter().map(|file| file.name)
    }

    /// The names of the traces, sorted.
    pub fn trace_names() -> impl Iterator<Item = &'static str> {
        TRACES.into_iter().map(|file| file.name)
    }
}
