//! Stories: how a field came to be, and so which class of rock and which size to expect where.

mod evidence;
mod layout;

use std::str::FromStr;

use farside::random::Stream;
use nalgebra::Point2;

pub use evidence::Evidence;
use layout::Layout;

use super::GeologyError;

/// How a field came to be.
///
/// ```
/// use farside_worlds::StoryKind;
/// let kind: StoryKind = "ejecta".parse()?;
/// assert_eq!(kind, StoryKind::Ejecta);
/// let error = "ejekta".parse::<StoryKind>().unwrap_err();
/// assert!(error.to_string().contains("did you mean \"ejecta\""));
/// # Ok::<(), farside_worlds::GeologyError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum StoryKind {
    /// Beds of rock, one above the other, that crop out as bands.
    ///
    /// Prior: bands run in any direction, are a share of 0.12 to 0.3 of the side wide, and wave by up
    /// to a quarter of their width.
    Strata,
    /// What an impact threw out of a crater.
    ///
    /// What lay deepest comes to lie nearest the rim (E. Shoemaker, *Impact mechanics at Meteor
    /// Crater*, 1963); the blanket thins with the cube of the distance (T. McGetchin and others, EPSL
    /// 20, 1973) and ends in older ground; blocks become smaller outwards (G. Bart and H. Melosh,
    /// Icarus 209, 2010). Prior: the crater lies within 0.45 sides of the middle; its radius is 0.1
    /// to 0.2 sides; the blanket has thinned to half at 2.5 to 4 radii; sizes correlate with nearness
    /// by 0.4 to 0.8.
    Ejecta,
    /// A lava flow over older ground.
    ///
    /// It has a core, rougher levees along its margins if there are three classes or more (R. Sparks
    /// and others, Geology 4, 1976), and a front; the largest blocks are those of its margins. Prior:
    /// it flows in any direction, passes the middle within 0.2 sides, is 0.24 to 0.5 sides wide,
    /// of which levees are 15 to 30 %, and ends 0 to 0.5 sides beyond the middle; sizes correlate by 0.2 to 0.5.
    Lava,
    /// What a flood carried down from many places and sorted.
    ///
    /// Stones become smaller downstream, exponentially (H. Sternberg, 1875; S. Rice and M. Church,
    /// Sedimentology 45, 1998). Weak kinds are the most frequent where the flood picks them up, and
    /// wear away first, their large stones before their small ones. Prior: any direction; over one
    /// side the weakest kind falls by e^4 to e^8 beside the strongest; all are as frequent at 0.3 to
    /// 0.7 of the way; sizes correlate with the way by 0.5 to 0.85.
    Outwash,
    /// No order: each class anywhere.
    ///
    /// Prior: each class has a weight of 0.5 and an exponential of mean 1.
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
        let names = StoryKind::ALL.map(StoryKind::name);
        if let Some(place) = names.iter().position(|known| *known == name) {
            return Ok(StoryKind::ALL[place]);
        }
        let distance = |known: &&str| strsim::damerau_levenshtein(known, name);
        let nearest = names.into_iter().min_by_key(distance).unwrap_or_default();
        Err(GeologyError::UnknownStory {
            name: name.chars().take(40).collect(),
            nearest,
            all: names.join(", "),
        })
    }
}

/// A story with its parameters: where beds, crater or flow lie in one field, and which class has
/// which part in it.
///
/// It gives the probability of each class at a place, and how sizes follow the place, so that one who
/// knows classes and sizes of some rocks can weigh stories against each other: the likelihood of an
/// [`Evidence`], averaged over many stories that are drawn from the prior of a kind.
///
/// The prior: parameters as [`StoryKind`] says, all uniform in their ranges and independent, which
/// class has which part equally likely any way, and of all rocks 5 to 25 % moved since (uniform as
/// well): those may be of any class. The last is not so for outwash and uniform ground, which are
/// mixed anyway.
///
/// ```
/// use farside::random::RandomKey;
/// use farside_worlds::{Story, StoryKind};
/// use nalgebra::Point2;
/// let mut stream = RandomKey::new(1).text("prior").stream();
/// let beds = Story::draw(StoryKind::Strata, 3, 100.0, &mut stream);
/// let mut shares = [0.0; 3];
/// beds.class_probabilities(Point2::new(10.0, -20.0), 0.5, &mut shares);
/// assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
/// assert!(shares.iter().any(|&share| share > 0.75)); // it lies on one of the beds
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Story {
    kind: StoryKind,
    side_m: f64,
    layout: Layout,
    /// The class that has each part, by part.
    class_of: Vec<u16>,
    /// The share of rocks that have stayed.
    stayed: f64,
    size_correlation: f64,
}

impl Story {
    /// A story of this kind with parameters drawn from their prior, for a field of this many classes
    /// and side \[m\].
    ///
    /// # Panics
    /// When there are no classes or more than 65,535.
    pub fn draw(kind: StoryKind, classes: usize, side_m: f64, stream: &mut Stream) -> Story {
        assert!(
            (1..=usize::from(u16::MAX)).contains(&classes),
            "{classes} classes"
        );
        let mut class_of: Vec<u16> = (0..classes as u16).collect();
        stream.shuffle(&mut class_of);
        let stayed = stream.uniform_in(0.75, 0.95);
        let (stayed, correlation) = match kind {
            StoryKind::Strata => (stayed, [0.0, 0.0]),
            StoryKind::Ejecta => (stayed, [0.4, 0.8]),
            StoryKind::Lava => (stayed, [0.2, 0.5]),
            StoryKind::Outwash => (1.0, [0.5, 0.85]),
            StoryKind::Uniform => (1.0, [0.0, 0.0]),
        };
        Story {
            kind,
            side_m,
            class_of,
            stayed,
            size_correlation: stream.uniform_in(correlation[0], correlation[1]),
            layout: Layout::draw(kind, classes, stream),
        }
    }

    /// Which kind it is.
    pub fn kind(&self) -> StoryKind {
        self.kind
    }

    /// How many classes it lays out.
    pub fn classes(&self) -> usize {
        self.class_of.len()
    }

    /// The probability of each class for a rock at a place \[m, from the field's middle\] and of a
    /// diameter \[m\]; `out` has one entry for each class, and they sum to 1.
    ///
    /// # Panics
    /// When `out` has another length.
    pub fn class_probabilities(&self, position_m: Point2<f64>, diameter_m: f64, out: &mut [f64]) {
        assert_eq!(out.len(), self.classes(), "one entry for each class");
        let moved = (1.0 - self.stayed) / self.classes() as f64;
        let place = position_m / self.side_m;
        self.layout
            .weights_into(place, diameter_m, &self.class_of, out);
        let whole: f64 = out.iter().sum();
        for share in out {
            *share = moved + self.stayed * *share / whole;
        }
    }

    /// How much a place \[m\] is one of large rocks: any number, the larger the larger the rocks. Only
    /// differences between places of one story mean something.
    pub fn size_trend(&self, position_m: Point2<f64>) -> f64 {
        self.layout.size_trend(position_m / self.side_m)
    }

    /// The correlation of [`Story::size_trend`] with sizes, 0 to 1: with their normal scores, that is
    /// with the standard normal variable that has the same rank. Sizes as such follow
    /// [`crate::RockAbundance`] whatever the story: it only moves them to their places.
    pub fn size_correlation(&self) -> f64 {
        self.size_correlation
    }
}
