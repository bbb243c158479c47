//! Pictures of a run: which a system has, what they are drawn from, and why there may be none.

use farside::SimDuration;
use farside::record::RecordClass;
use thiserror::Error;

use super::Seeds;

/// A picture that a system can draw of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureInfo {
    /// Its name: `map`.
    pub name: &'static str,
    /// What it shows, in a line.
    pub about: &'static str,
    /// The options that it takes.
    pub takes: &'static [PictureOption],
    /// What it shows only if asked, each by a name and in a line; for [`PictureOption::With`].
    pub extras: &'static [(&'static str, &'static str)],
}

/// Something that a picture may be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureOption {
    /// An instant, or the end of a time span.
    At,
    /// The beginning of a time span.
    From,
    /// Along what: a line of vertices, a timeline, a resource.
    Along,
    /// What is shown besides, of what [`PictureInfo::extras`] names.
    With,
}

impl PictureOption {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            PictureOption::At => "at",
            PictureOption::From => "from",
            PictureOption::Along => "along",
            PictureOption::With => "with",
        }
    }
}

/// What is asked for besides a picture's name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PictureRequest {
    /// The instant, or the end of the time span; the end of the run unless given.
    pub at: Option<SimDuration>,
    /// The beginning of the time span; the start of the run unless given.
    pub from: Option<SimDuration>,
    /// Along what.
    pub along: Option<String>,
    /// What is shown besides: names of [`PictureInfo::extras`], each checked.
    pub with: Vec<String>,
}

/// A run that was recorded, as pictures read it.
pub trait Recording {
    /// The run's seeds.
    fn seeds(&self) -> Seeds;

    /// The scenario's name.
    fn scenario(&self) -> &str;

    /// The topics that were not written, as globs.
    fn excluded(&self) -> &[String];

    /// Hands out every committed record in order; returns how the run ended.
    ///
    /// # Errors
    /// When it cannot be read, and those of `visit`.
    fn for_each(
        &self,
        visit: &mut dyn FnMut(&Recorded<'_>) -> Result<(), PictureError>,
    ) -> Result<RecordingEnd, PictureError>;
}

/// One record of a run.
#[derive(Clone, Copy, Debug)]
pub struct Recorded<'a> {
    /// When, in nanoseconds since the start of the run.
    pub time_ns: u64,
    /// What happened.
    pub class: RecordClass,
    /// The name of who it happened to: who gets a message, who crashed, which link changed.
    pub actor: &'a str,
    /// The kind of the message or state sample: its serde name.
    pub kind: &'a str,
    /// The message or sample, encoded.
    pub body: &'a [u8],
}

/// How a recorded run ended.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordingEnd {
    /// When, in nanoseconds since the start of the run; none if the recording is cut.
    pub time_ns: Option<u64>,
    /// Why; empty if the recording is cut.
    pub detail: String,
}

/// Why there is no picture.
#[derive(Debug, Error)]
pub enum PictureError {
    /// The recording cannot be read.
    #[error("{0}")]
    Unreadable(String),
    /// The system has no such picture.
    #[error("there is no picture {picture:?}")]
    Unknown {
        /// What was asked for.
        picture: String,
    },
    /// It cannot be drawn of this run, or not so.
    #[error("{0}")]
    NotDrawn(String),
    /// The settings of the run cannot be.
    #[error(transparent)]
    Setup(#[from] super::SetupError),
}
