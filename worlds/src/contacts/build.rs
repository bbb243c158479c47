//! From contacts in the order of a file to a plan in canonical order: what both formats share.

use std::collections::BTreeMap;

use farside::{SimDuration, SimTime};

use super::error::{Faults, Remarks, shown};
use super::{
    ContactError, ContactPlan, ContactProblem, ContactWindow, MAX_CONTACTS, MAX_RATE_BIT_PER_S,
    Node, Note, Pair,
};
use crate::decimal::NumberError;

/// The most characters of a node's name.
const MAX_NAME: usize = 64;

/// A contact as a file has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct RawContact {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) window: ContactWindow,
    pub(super) confidence: Option<f64>,
    pub(super) line: usize,
}

/// The nodes of a file, each once, numbered as they first appear.
#[derive(Default)]
pub(super) struct Nodes {
    known: BTreeMap<String, u32>,
    all: Vec<Node>,
}

impl Nodes {
    /// The node's number. `None` if the text is no name of a node.
    pub(super) fn number(&mut self, text: &str, line: usize) -> Option<u32> {
        Some(self.taken(canonical_name(text)?, line))
    }

    /// The number of the node of this name, whatever that is.
    fn taken(&mut self, name: String, line: usize) -> u32 {
        if let Some(number) = self.known.get(&name) {
            return *number;
        }
        // Files are far too small to name so many.
        let number = self.all.len() as u32;
        self.known.insert(name.clone(), number);
        self.all.push(Node { name, line });
        number
    }

    pub(super) fn name(&self, number: u32) -> &str {
        &self.all[number as usize].name
    }

    /// Whether a range from `a` to `b` says nothing about the way back: between numbers, if the
    /// first is the greater one.
    pub(super) fn is_one_way(&self, a: u32, b: u32) -> bool {
        match (node_order(self.name(a)), node_order(self.name(b))) {
            (NodeOrder::Number(a), NodeOrder::Number(b)) => a > b,
            _ => false,
        }
    }
}

/// Where a node stands among others: numbers first.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum NodeOrder<'a> {
    Number(u64),
    Name(&'a str),
}

pub(super) fn node_order(name: &str) -> NodeOrder<'_> {
    match name.parse() {
        Ok(number) if name.bytes().all(|byte| byte.is_ascii_digit()) => NodeOrder::Number(number),
        _ => NodeOrder::Name(name),
    }
}

/// What a node's name may be.
pub(super) const NODE_EXPECTED: &str =
    "a node's number below 2^64, or a name of letters, digits, `_`, `-`, `.`, `:` or `/`";

/// The name as plans have it; of numbers the leading zeros go.
fn canonical_name(text: &str) -> Option<String> {
    if !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit()) {
        return text.parse::<u64>().ok().map(|number| number.to_string());
    }
    let good = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | ':' | '/');
    let begins = text.starts_with(|c: char| c.is_alphabetic() || c == '_');
    let fits = text.chars().count() <= MAX_NAME;
    (begins && fits && text.chars().all(good)).then(|| text.to_owned())
}

/// Checks that something ends after it begins.
pub(super) fn check_order(line: usize, start: u64, end: u64) -> Result<(), ContactError> {
    if start < end {
        return Ok(());
    }
    let text = |nanos| SimTime::from_nanos(nanos).to_string();
    let problem = ContactProblem::EndsBeforeItBegins {
        start: text(start),
        end: text(end),
    };
    Err(ContactError::at(line, problem))
}

/// Checks a rate: not zero, and none that nobody means.
pub(super) fn is_sane_rate(bit_per_s: u64) -> bool {
    (1..=MAX_RATE_BIT_PER_S).contains(&bit_per_s)
}

/// A number that cannot be, with what was expected in general, or what exactly is wrong.
pub(super) fn bad_number(
    field: &'static str,
    found: &str,
    error: NumberError,
    expected: &'static str,
) -> ContactProblem {
    ContactProblem::Field {
        field,
        found: shown(found),
        expected: match error {
            NumberError::NotANumber => expected,
            NumberError::Negative => "a number that is not negative",
            NumberError::TooFine => "a number without so many decimal places",
            NumberError::TooLarge => "a smaller number",
        },
    }
}

/// More entries than are read.
pub(super) fn too_many(what: &'static str, line: usize) -> ContactError {
    let limit = MAX_CONTACTS;
    ContactError::at(line, ContactProblem::TooMany { what, limit })
}

/// Which contacts of one ordered pair may overlap: they become one.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Overlaps {
    /// None.
    Never,
    /// Those that say the same: ION passes over the second.
    IfEqual,
    /// Those of one rate and light time: HDTN transmits while any is on.
    IfAlike,
}

impl Overlaps {
    fn allow(self, a: &RawContact, b: &RawContact) -> bool {
        let alike = (a.window.rate_bit_per_s, a.window.owlt, a.confidence)
            == (b.window.rate_bit_per_s, b.window.owlt, b.confidence);
        match self {
            Overlaps::Never => false,
            Overlaps::IfEqual => alike && a.window == b.window,
            Overlaps::IfAlike => alike,
        }
    }
}

/// What a reader found in a file.
#[derive(Default)]
pub(super) struct Found {
    pub(super) nodes: Nodes,
    pub(super) contacts: Vec<RawContact>,
    pub(super) faults: Faults,
    pub(super) remarks: Remarks,
}

/// The plan of what was found.
pub(super) fn plan(found: Found, overlaps: Overlaps) -> Result<ContactPlan, ContactError> {
    if found.contacts.is_empty() {
        found.faults.check()?;
        return Err(ContactError::Empty { what: "contact" });
    }
    arranged(found, overlaps)
}

/// The plan with its nodes called `name` of theirs, and so much later; contacts of a node with
/// itself are left out. `None` if time does not reach so far.
///
/// # Errors
/// When two nodes get one name, and with that contacts that overlap.
pub(super) fn renamed(
    plan: &ContactPlan,
    name: impl Fn(&str) -> String,
    offset: SimDuration,
) -> Option<Result<ContactPlan, ContactError>> {
    let mut found = Found {
        remarks: plan.remarks.clone(),
        ..Found::default()
    };
    let numbers: Vec<u32> = plan
        .nodes
        .iter()
        .map(|node| found.nodes.taken(name(&node.name), node.line))
        .collect();
    let later = |time: SimTime| time.as_nanos().checked_add(offset.as_nanos());
    for pair in plan.pairs.iter().filter(|pair| pair.from != pair.to) {
        for at in pair.first..pair.end {
            let window = plan.windows[at];
            found.contacts.push(RawContact {
                from: numbers[pair.from as usize],
                to: numbers[pair.to as usize],
                window: ContactWindow {
                    start: SimTime::from_nanos(later(window.start)?),
                    end: SimTime::from_nanos(later(window.end)?),
                    ..window
                },
                confidence: plan.notes[at].confidence,
                line: plan.notes[at].line,
            });
        }
    }
    Some(arranged(found, Overlaps::Never))
}

/// Contacts in canonical order.
fn arranged(found: Found, overlaps: Overlaps) -> Result<ContactPlan, ContactError> {
    let Found {
        mut nodes,
        mut contacts,
        mut faults,
        mut remarks,
    } = found;
    let mut order: Vec<u32> = (0..nodes.all.len() as u32).collect();
    order.sort_by(|a, b| node_order(nodes.name(*a)).cmp(&node_order(nodes.name(*b))));
    let mut rank = vec![0u32; order.len()];
    for (place, number) in order.iter().enumerate() {
        rank[*number as usize] = place as u32;
    }
    for contact in &mut contacts {
        contact.from = rank[contact.from as usize];
        contact.to = rank[contact.to as usize];
    }
    contacts.sort_by_key(|c| (c.from, c.to, c.window.start, c.line));
    nodes
        .all
        .sort_by(|a, b| node_order(&a.name).cmp(&node_order(&b.name)));
    let name = |number: u32| nodes.all[number as usize].name.clone();
    // Sorted by their start, contacts of which none overlaps the next do not overlap at all.
    contacts.dedup_by(|b, a| {
        if (a.from, a.to) != (b.from, b.to) || b.window.start >= a.window.end {
            return false;
        }
        let (line, other_line) = (a.line.max(b.line), a.line.min(b.line));
        let allowed = overlaps.allow(a, b);
        if allowed {
            a.window.end = a.window.end.max(b.window.end);
            remarks.push(line, || {
                format!("the contact overlaps that of line {other_line}: they are one")
            });
        } else {
            let (from, to) = (name(a.from), name(a.to));
            let problem = ContactProblem::Overlap {
                from,
                to,
                other_line,
            };
            faults.push(ContactError::at(line, problem));
        }
        allowed
    });
    faults.check()?;
    let mut pairs: Vec<Pair> = Vec::new();
    for (at, contact) in contacts.iter().enumerate() {
        match pairs.last_mut() {
            Some(last) if (last.from, last.to) == (contact.from, contact.to) => last.end = at + 1,
            _ => pairs.push(Pair {
                from: contact.from,
                to: contact.to,
                first: at,
                end: at + 1,
            }),
        }
    }
    let note = |contact: &RawContact| Note {
        confidence: contact.confidence,
        line: contact.line,
    };
    Ok(ContactPlan {
        nodes: nodes.all,
        pairs,
        windows: contacts.iter().map(|contact| contact.window).collect(),
        notes: contacts.iter().map(note).collect(),
        remarks,
    })
}

/// A window from numbers that were checked.
pub(super) fn window(
    start: u64,
    end: u64,
    rate_bit_per_s: Option<u64>,
    owlt: u64,
) -> ContactWindow {
    ContactWindow {
        start: SimTime::from_nanos(start),
        end: SimTime::from_nanos(end),
        rate_bit_per_s,
        owlt: SimDuration::from_nanos(owlt),
    }
}
