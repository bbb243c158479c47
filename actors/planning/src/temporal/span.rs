//! Spans of ticks, or of other whole numbers: a least and a greatest value.

use std::fmt;

use crate::Ticks;

/// A least and a greatest value \[ticks\], both included.
///
/// ```
/// use farside_planning::temporal::Span;
/// assert_eq!(Span::new(2, 5).intersect(Span::at_least(4)), Span::new(4, 5));
/// assert!(Span::new(5, 2).is_empty());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Span {
    /// The least; none if it is [`Ticks::MIN`].
    pub min: Ticks,
    /// The greatest; none if it is [`Ticks::MAX`].
    pub max: Ticks,
}

impl Span {
    /// All values.
    pub const ALL: Span = Span::new(Ticks::MIN, Ticks::MAX);

    /// From `min` to `max`.
    pub const fn new(min: Ticks, max: Ticks) -> Span {
        Span { min, max }
    }

    /// One value.
    pub const fn exactly(value: Ticks) -> Span {
        Span::new(value, value)
    }

    /// From `min` on.
    pub const fn at_least(min: Ticks) -> Span {
        Span::new(min, Ticks::MAX)
    }

    /// Up to `max`.
    pub const fn at_most(max: Ticks) -> Span {
        Span::new(Ticks::MIN, max)
    }

    /// What is in both.
    #[must_use]
    pub fn intersect(self, other: Span) -> Span {
        Span::new(self.min.max(other.min), self.max.min(other.max))
    }

    /// Of the negatives of what is in it.
    #[must_use]
    pub fn negated(self) -> Span {
        Span::new(negated(self.max), negated(self.min))
    }

    /// Whether no value is in it.
    pub const fn is_empty(self) -> bool {
        self.min > self.max
    }

    /// Whether a value is in it.
    pub const fn contains(self, value: Ticks) -> bool {
        self.min <= value && value <= self.max
    }
}

impl fmt::Debug for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.min, self.max) {
            (Ticks::MIN, Ticks::MAX) => f.write_str("[-inf inf]"),
            (Ticks::MIN, max) => write!(f, "[-inf {max}]"),
            (min, Ticks::MAX) => write!(f, "[{min} inf]"),
            (min, max) => write!(f, "[{min} {max}]"),
        }
    }
}

/// The negative, which of no bound is none.
pub(super) fn negated(bound: Ticks) -> Ticks {
    match bound {
        Ticks::MAX => Ticks::MIN,
        Ticks::MIN => Ticks::MAX,
        bound => -bound,
    }
}
