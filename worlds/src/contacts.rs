//! Contact plans and capacity traces: when which node hears which, how fast and how late, as
//! other programs wrote it down. It routes nothing and sends nothing; links do, given the windows.
//!
//! Three formats are read. The files are foreign: any bytes give a plan, a trace, or an error that
//! names the line, within bounded memory.
//!
//! - **ION** ([`ContactPlan::from_ion`]): the contact and range commands of `ionrc(5)`, of NASA
//!   JPL's Interplanetary Overlay Network. Rates are in **bytes** per second.
//! - **HDTN** ([`ContactPlan::from_hdtn`]): the JSON contact plans of NASA Glenn's High-rate Delay
//!   Tolerant Network. Rates are in **bits** per second.
//! - **mahimahi** ([`CapacityTrace::from_mahimahi`]): recorded links, a millisecond for each packet
//!   that they could have delivered (Netravali et al., USENIX ATC 2015).
//!
//! Times are whole nanoseconds. Decimals are read exactly, never through a float.
//!
//! ```
//! use farside_worlds::contacts::ContactPlan;
//! let text = "
//!     a range   +0  +3600  1 2  1.28
//!     a contact +60 +120   1 2  16000
//! ";
//! let plan = ContactPlan::from_ion(text.as_bytes())?;
//! let windows = plan.contact_windows("1", "2");
//! assert_eq!(windows.len(), 1);
//! assert_eq!(windows[0].rate_bit_per_s, Some(128_000));
//! assert_eq!(windows[0].owlt.to_string(), "1.28s");
//! # Ok::<(), farside_worlds::contacts::ContactError>(())
//! ```

mod build;
mod builtin;
mod error;
mod hdtn;
mod ion;
mod summary;
mod trace;

use farside::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

pub use builtin::Builtin;
use error::Remarks;
pub(crate) use error::shown;
pub use error::{ContactError, ContactProblem, MAX_FAULTS, Position};
pub use summary::{Gap, PairSummary, PlanSummary};
pub use trace::CapacityTrace;

/// The most bytes of a contact plan or trace that are read.
pub const MAX_FILE_BYTES: usize = 16 << 20;

/// The most contacts, and the most ranges, of a plan.
pub const MAX_CONTACTS: usize = 200_000;

/// The highest rate of a contact \[bit/s\]: a thousand times what optical links reach today.
pub const MAX_RATE_BIT_PER_S: u64 = 1_000_000_000_000_000;

/// When one node hears another: from `start` on, and no more at `end`.
///
/// ```
/// use farside::{SimDuration, SimTime};
/// use farside_worlds::contacts::ContactWindow;
/// let pass = ContactWindow {
///     start: SimTime::ZERO,
///     end: SimTime::ZERO + SimDuration::from_secs(480),
///     rate_bit_per_s: Some(128_000),
///     owlt: SimDuration::from_millis(2),
/// };
/// assert_eq!(pass.volume_bytes(), Some(7_680_000));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ContactWindow {
    /// The first instant at which the sender may transmit.
    pub start: SimTime,
    /// The first instant at which it may no longer; after `start`.
    pub end: SimTime,
    /// The rate of transmission \[bit/s\], from 1 to [`MAX_RATE_BIT_PER_S`]; `None` where the plan
    /// sets no limit.
    pub rate_bit_per_s: Option<u64>,
    /// The one-way light time.
    pub owlt: SimDuration,
}

impl ContactWindow {
    /// How long the window is open.
    pub fn open(&self) -> SimDuration {
        self.end.since(self.start)
    }

    /// How many whole bytes fit through it; `None` if any number does.
    pub fn volume_bytes(&self) -> Option<u64> {
        self.volume_nanobits().map(summary::whole_bytes)
    }

    /// The volume in units of 10^-9 bit, which is exact.
    fn volume_nanobits(&self) -> Option<u128> {
        let rate = u128::from(self.rate_bit_per_s?);
        Some(rate * u128::from(self.open().as_nanos()))
    }
}

/// One contact of a plan, with all that the plan says about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact<'a> {
    /// The sending node.
    pub from: &'a str,
    /// The receiving node.
    pub to: &'a str,
    /// When, how fast, how late.
    pub window: ContactWindow,
    /// How likely the contact is to happen, over 0 and at most 1, where the plan says so.
    pub confidence: Option<f64>,
    /// The line of the file that it stands on, from 1.
    pub line: usize,
}

/// The contacts of some nodes, in canonical order: by sending node, receiving node and time;
/// numbers before names, and by their value. The contacts of one ordered pair never overlap.
///
/// Two plans are equal if they have the same contacts, wherever those stood in their files.
///
/// ```
/// use farside_worlds::contacts::{ContactFormat, ContactPlan};
/// let hdtn = br#"{ "contacts": [
///     { "source": 10, "dest": 2, "startTime": 0, "endTime": 60,
///       "rateBitsPerSec": 8000, "owlt": 1 }
/// ] }"#;
/// let ion = b"a range +0 +60 2 10 1\na contact +0 +60 10 2 1000";
/// let plan = ContactPlan::from_bytes(hdtn, ContactFormat::Hdtn)?;
/// assert_eq!(plan, ContactPlan::from_bytes(ion, ContactFormat::Ion)?);
/// # Ok::<(), farside_worlds::contacts::ContactError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ContactPlan {
    nodes: Vec<Node>,
    pairs: Vec<Pair>,
    windows: Vec<ContactWindow>,
    /// Beside each window, what links do not need.
    notes: Vec<Note>,
    remarks: Remarks,
}

#[derive(Clone, Debug)]
struct Node {
    name: String,
    /// The first line that names it.
    line: usize,
}

/// An ordered pair of nodes with contacts, and where they are among the windows.
#[derive(Clone, Copy, Debug)]
struct Pair {
    from: u32,
    to: u32,
    first: usize,
    end: usize,
}

#[derive(Clone, Copy, Debug)]
struct Note {
    confidence: Option<f64>,
    line: usize,
}

/// The formats of contact plans.
///
/// ```
/// use farside_worlds::contacts::ContactFormat;
/// assert_eq!(ContactFormat::guess("plan.json", b""), ContactFormat::Hdtn);
/// assert_eq!(ContactFormat::guess("plan.txt", b" {\"contacts\""), ContactFormat::Hdtn);
/// assert_eq!(ContactFormat::guess("host1.rc", b"# a plan"), ContactFormat::Ion);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContactFormat {
    /// ION's `ionrc` commands.
    Ion,
    /// HDTN's JSON.
    Hdtn,
}

impl ContactFormat {
    /// What a file probably is, by its ending, or else by its first character.
    pub fn guess(file_name: &str, bytes: &[u8]) -> Self {
        let ending = file_name.rsplit_once('.').map_or("", |(_, ending)| ending);
        let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
        let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
        match ending {
            "json" => ContactFormat::Hdtn,
            "ionrc" | "rc" => ContactFormat::Ion,
            _ if matches!(first, Some(b'{' | b'[')) => ContactFormat::Hdtn,
            _ => ContactFormat::Ion,
        }
    }
}

impl ContactPlan {
    /// Reads a plan of a format that is known.
    ///
    /// # Errors
    /// Those of [`ContactPlan::from_ion`] and [`ContactPlan::from_hdtn`].
    pub fn from_bytes(bytes: &[u8], format: ContactFormat) -> Result<ContactPlan, ContactError> {
        ContactPlan::read(bytes, format, None)
    }

    /// Reads a plan of a format that is known, with a one-way light time for the contacts of which
    /// the file tells none.
    ///
    /// ```
    /// use farside::SimDuration;
    /// use farside_worlds::contacts::{ContactFormat, ContactPlan};
    /// let (text, second) = (b"a contact +0 +60 1 2 1000", SimDuration::from_secs(1));
    /// assert!(ContactPlan::read(text, ContactFormat::Ion, None).is_err());
    /// let plan = ContactPlan::read(text, ContactFormat::Ion, Some(second))?;
    /// assert_eq!(plan.contact_windows("1", "2")[0].owlt, second);
    /// # Ok::<(), farside_worlds::contacts::ContactError>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`ContactPlan::from_ion`] and [`ContactPlan::from_hdtn`].
    pub fn read(
        bytes: &[u8],
        format: ContactFormat,
        light_time: Option<SimDuration>,
    ) -> Result<ContactPlan, ContactError> {
        match format {
            ContactFormat::Ion => ion::read(bytes, light_time),
            ContactFormat::Hdtn => hdtn::read(bytes, light_time),
        }
    }

    /// What is to be said of the file, a line each: contacts that were passed over, and what it
    /// says without effect.
    ///
    /// ```
    /// use farside_worlds::contacts::ContactPlan;
    /// let text = b"a range +0 +60 1 2 1\na contact +0 +60 1 2 1000 0.5";
    /// let plan = ContactPlan::from_ion(text)?;
    /// let said: Vec<String> = plan.remarks().collect();
    /// assert_eq!(said, ["line 2: confidence 0.5 is not used: the contact takes place"]);
    /// # Ok::<(), farside_worlds::contacts::ContactError>(())
    /// ```
    pub fn remarks(&self) -> impl Iterator<Item = String> + '_ {
        self.remarks.all()
    }

    /// The windows of the contacts from one node to another, in order of time and without
    /// overlaps; none if the plan has no such contact.
    pub fn contact_windows(&self, from: &str, to: &str) -> &[ContactWindow] {
        let index = |name: &str| self.node(name).and_then(|at| u32::try_from(at).ok());
        let (Some(from), Some(to)) = (index(from), index(to)) else {
            return &[];
        };
        let found = self
            .pairs
            .binary_search_by_key(&(from, to), |pair| (pair.from, pair.to));
        found.map_or(&[], |at| self.windows_of(&self.pairs[at]))
    }

    /// The windows from one node to another, where the plan has any say: `None` if it does not name
    /// both, none at all if it does but has no contact between them.
    ///
    /// ```
    /// use farside_worlds::contacts::ContactPlan;
    /// let plan = ContactPlan::from_ion(b"a range +0 +60 1 2 1\na contact +0 +60 1 2 1000")?;
    /// assert_eq!(plan.windows_between("1", "2").map(<[_]>::len), Some(1));
    /// assert_eq!(plan.windows_between("2", "1"), Some(&[][..]));
    /// assert_eq!(plan.windows_between("2", "3"), None);
    /// # Ok::<(), farside_worlds::contacts::ContactError>(())
    /// ```
    pub fn windows_between(&self, from: &str, to: &str) -> Option<&[ContactWindow]> {
        let names = |node: &str| self.node(node).is_some();
        (names(from) && names(to)).then(|| self.contact_windows(from, to))
    }

    /// The plan with its nodes called `name` of theirs, as hosts are, and so much later. Contacts
    /// of a node with itself, which some plans have, are left out. `None` if it would last longer
    /// than virtual time, 584 years.
    ///
    /// ```
    /// use farside::SimDuration;
    /// use farside_worlds::contacts::ContactPlan;
    /// let plan = ContactPlan::from_ion(b"a range +0 +60 1 2 1\na contact +0 +60 1 2 1000")?;
    /// let hour = SimDuration::from_secs(3600);
    /// let plan = plan.renamed(|node| format!("rover_{node}"), hour).unwrap()?;
    /// assert_eq!(plan.contact_windows("rover_1", "rover_2")[0].start.to_string(), "3600s");
    /// # Ok::<(), farside_worlds::contacts::ContactError>(())
    /// ```
    ///
    /// # Errors
    /// When two nodes get one name, and with that contacts that overlap.
    pub fn renamed(
        &self,
        name: impl Fn(&str) -> String,
        offset: SimDuration,
    ) -> Option<Result<ContactPlan, ContactError>> {
        build::renamed(self, name, offset)
    }

    /// Each ordered pair of nodes with contacts, and their windows, in canonical order.
    pub fn pairs(&self) -> impl Iterator<Item = (&str, &str, &[ContactWindow])> {
        self.pairs.iter().map(|pair| {
            let (from, to) = self.names_of(pair);
            (from, to, self.windows_of(pair))
        })
    }

    /// Every contact, in canonical order.
    pub fn contacts(&self) -> impl Iterator<Item = Contact<'_>> {
        self.pairs.iter().flat_map(move |pair| {
            let (from, to) = self.names_of(pair);
            (pair.first..pair.end).map(move |at| Contact {
                from,
                to,
                window: self.windows[at],
                confidence: self.notes[at].confidence,
                line: self.notes[at].line,
            })
        })
    }

    /// The nodes that contacts or ranges name, numbers first, and the first line that names each.
    pub fn nodes(&self) -> impl Iterator<Item = (&str, usize)> {
        self.nodes
            .iter()
            .map(|node| (node.name.as_str(), node.line))
    }

    /// How many contacts there are; at least one in a plan that was read.
    #[expect(clippy::len_without_is_empty, reason = "no file of a plan is empty")]
    pub fn len(&self) -> usize {
        self.windows.len()
    }

    /// When the first contact begins.
    pub fn start(&self) -> SimTime {
        let starts = self.windows.iter().map(|window| window.start);
        starts.min().unwrap_or(SimTime::ZERO)
    }

    /// When the last contact ends.
    pub fn end(&self) -> SimTime {
        let ends = self.windows.iter().map(|window| window.end);
        ends.max().unwrap_or(SimTime::ZERO)
    }

    fn node(&self, name: &str) -> Option<usize> {
        let key = build::node_order(name);
        let found = self
            .nodes
            .binary_search_by(|node| build::node_order(&node.name).cmp(&key));
        found.ok()
    }

    fn names_of(&self, pair: &Pair) -> (&str, &str) {
        let name = |index: u32| self.nodes[index as usize].name.as_str();
        (name(pair.from), name(pair.to))
    }

    fn windows_of(&self, pair: &Pair) -> &[ContactWindow] {
        &self.windows[pair.first..pair.end]
    }
}

impl PartialEq for ContactPlan {
    fn eq(&self, other: &Self) -> bool {
        // Lines tell where a contact stood, not what it is.
        let told = |contact: Contact<'_>, other: Contact<'_>| {
            Contact { line: 0, ..contact } == Contact { line: 0, ..other }
        };
        self.len() == other.len()
            && self
                .contacts()
                .zip(other.contacts())
                .all(|(a, b)| told(a, b))
    }
}

/// What some editors put before text in UTF-8.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// The file as text, without a byte-order mark.
fn text_of(bytes: &[u8]) -> Result<&str, ContactError> {
    if bytes.len() > MAX_FILE_BYTES {
        return Err(ContactError::TooLarge {
            limit_bytes: MAX_FILE_BYTES,
            actual_bytes: bytes.len(),
        });
    }
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let newlines = before.iter().filter(|byte| **byte == b'\n').count();
        ContactError::NotText { line: newlines + 1 }
    })
}

#[cfg(test)]
mod tests;
