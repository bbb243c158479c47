//! What a plan comes to: how often, how long and how much each node can send to each other.

use std::fmt;

use farside::{SimDuration, SimTime};

use super::{ContactPlan, ContactWindow};

/// What a plan comes to. Printed, it is a few lines for people: one for the plan, one for each
/// ordered pair.
///
/// ```
/// use farside_worlds::contacts::ContactPlan;
/// let text = b"a range +0 +90 1 2 1\na contact +0 +30 1 2 1000\na contact +70 +90 1 2 1000\n\
///              a contact +0 +90 2 1 50";
/// let summary = ContactPlan::from_ion(text)?.summary();
/// assert_eq!(summary.to_string(), "\
/// 3 contacts of 2 ordered pairs from 0s to 90s: 54500 bytes in all
/// 1 -> 2: 2 contacts, 50000 bytes, open for 50s, longest gap 40s from 30s
/// 2 -> 1: 1 contact, 4500 bytes, open for 90s, no gap");
/// # Ok::<(), farside_worlds::contacts::ContactError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlanSummary {
    /// When the first contact of any pair begins.
    pub start: SimTime,
    /// When the last one ends. From `start` to here is the plan's horizon.
    pub end: SimTime,
    /// How many contacts there are.
    pub contacts: usize,
    /// How many whole bytes fit through all of them; `None` if there is no limit.
    pub volume_bytes: Option<u64>,
    /// Each ordered pair that has contacts, in canonical order.
    pub pairs: Vec<PairSummary>,
}

/// What the contacts from one node to another come to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PairSummary {
    /// The sending node.
    pub from: String,
    /// The receiving node.
    pub to: String,
    /// How many contacts there are.
    pub contacts: usize,
    /// How many whole bytes fit through them; `None` if there is no limit.
    pub volume_bytes: Option<u64>,
    /// How long they last together.
    pub open: SimDuration,
    /// The longest time within the plan's horizon without a contact, if there is any; the first
    /// of several.
    pub longest_gap: Option<Gap>,
}

/// A time without contacts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// When it begins.
    pub start: SimTime,
    /// When it ends.
    pub end: SimTime,
}

impl ContactPlan {
    /// What the plan comes to.
    pub fn summary(&self) -> PlanSummary {
        PlanSummary::of(self.pairs())
    }
}

impl PlanSummary {
    /// What these windows come to: of each ordered pair its names and its windows, in order and
    /// without overlaps.
    pub fn of<'a>(pairs: impl Iterator<Item = (&'a str, &'a str, &'a [ContactWindow])>) -> Self {
        let pairs: Vec<_> = pairs.collect();
        let windows = || pairs.iter().flat_map(|(_, _, windows)| *windows);
        let start = windows().map(|w| w.start).min().unwrap_or(SimTime::ZERO);
        let end = windows().map(|w| w.end).max().unwrap_or(SimTime::ZERO);
        let pair = |(from, to, windows): &(&str, &str, &[ContactWindow])| PairSummary {
            from: (*from).to_owned(),
            to: (*to).to_owned(),
            contacts: windows.len(),
            volume_bytes: volume(windows.iter()),
            open: windows
                .iter()
                .map(ContactWindow::open)
                .fold(SimDuration::ZERO, |a, b| a + b),
            longest_gap: longest_gap(windows, start, end),
        };
        PlanSummary {
            start,
            end,
            contacts: windows().count(),
            volume_bytes: volume(windows()),
            pairs: pairs.iter().map(pair).collect(),
        }
    }
}

fn volume<'a>(windows: impl Iterator<Item = &'a ContactWindow>) -> Option<u64> {
    // 200,000 contacts of 584 years at the highest rate are below 2^128 still.
    let nanobits = windows
        .map(ContactWindow::volume_nanobits)
        .sum::<Option<u128>>();
    nanobits.map(whole_bytes)
}

/// How many whole bytes so many 10^-9 bit are.
pub(super) fn whole_bytes(nanobits: u128) -> u64 {
    u64::try_from(nanobits / 8_000_000_000).unwrap_or(u64::MAX)
}

fn longest_gap(windows: &[ContactWindow], start: SimTime, end: SimTime) -> Option<Gap> {
    let begins = std::iter::once(start).chain(windows.iter().map(|w| w.end));
    let ends = windows.iter().map(|w| w.start).chain(std::iter::once(end));
    let mut longest: Option<Gap> = None;
    for (start, end) in begins.zip(ends) {
        let length = longest.map_or(SimDuration::ZERO, |gap| gap.length());
        if end.since(start) > length {
            longest = Some(Gap { start, end });
        }
    }
    longest
}

impl Gap {
    /// How long it lasts.
    pub fn length(&self) -> SimDuration {
        self.end.since(self.start)
    }
}

impl fmt::Display for PlanSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} from {} to {}: {} in all",
            counted(self.contacts, "contact"),
            counted(self.pairs.len(), "ordered pair"),
            self.start,
            self.end,
            bytes(self.volume_bytes)
        )?;
        self.pairs.iter().try_for_each(|pair| write!(f, "\n{pair}"))
    }
}

impl fmt::Display for PairSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let contacts = counted(self.contacts, "contact");
        let (from, to, open) = (&self.from, &self.to, self.open);
        let bytes = bytes(self.volume_bytes);
        write!(f, "{from} -> {to}: {contacts}, {bytes}, open for {open}, ")?;
        match self.longest_gap {
            Some(gap) => write!(f, "longest gap {} from {}", gap.length(), gap.start),
            None => f.write_str("no gap"),
        }
    }
}

fn bytes(volume: Option<u64>) -> String {
    match volume {
        Some(bytes) => format!("{bytes} bytes"),
        None => "any number of bytes".to_owned(),
    }
}

fn counted(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}
