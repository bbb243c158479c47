//! Which values a variable can have: an interval, or a finite set.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use crate::model::{Value, Values};
use crate::temporal::Span;

/// Values: all of an interval, or some of them.
///
/// Where the least and the greatest lie less than 64 apart, it is exact: any values can be left
/// out. A wider one is exact if it was made from single values ([`Domain::of`]); an interval keeps
/// what lies between its ends, and only its ends can be left out. Only wide sets of single values
/// take memory of their own, which copies share.
///
/// ```
/// use farside_planning::parameters::Domain;
/// use farside_planning::temporal::Span;
/// let small = Domain::from(Span::new(1, 5)).without(3);
/// assert_eq!(small.values().collect::<Vec<_>>(), [1, 2, 4, 5]);
/// let wide = Domain::of([10, 700, 20_000]);
/// assert_eq!(wide.intersect(&Span::at_most(5_000).into()), Domain::of([700, 10]));
/// assert_eq!(small.intersect(&Domain::of([2, 3, 9])).value(), Some(2));
/// ```
#[derive(Clone)]
pub struct Domain {
    min: Value,
    max: Value,
    inner: Inner,
}

/// What lies between the ends.
#[derive(Clone)]
enum Inner {
    /// Everything; the ends lie 64 or more apart, or nothing is in it at all.
    Interval,
    /// What bits say, the lowest for the least value; the ends lie less than 64 apart.
    Bits(u64),
    /// These, in rising order, as far as they lie within the ends, which are 64 or more apart.
    Set(Arc<Vec<Value>>),
}

/// The width from which on bits do not do.
const BITS: u64 = 64;

impl Domain {
    /// All values.
    pub const ALL: Domain = Domain {
        min: Value::MIN,
        max: Value::MAX,
        inner: Inner::Interval,
    };

    /// No value.
    pub const NONE: Domain = Domain {
        min: 1,
        max: 0,
        inner: Inner::Interval,
    };

    /// One value.
    pub const fn exactly(value: Value) -> Domain {
        Domain {
            min: value,
            max: value,
            inner: Inner::Bits(1),
        }
    }

    /// These values, in any order.
    pub fn of(values: impl IntoIterator<Item = Value>) -> Domain {
        let mut values: Vec<Value> = values.into_iter().collect();
        values.sort_unstable();
        values.dedup();
        Domain::of_rising(&values)
    }

    /// These values, which rise.
    pub(super) fn of_rising(values: &[Value]) -> Domain {
        let (Some(&min), Some(&max)) = (values.first(), values.last()) else {
            return Domain::NONE;
        };
        let inner = if max.abs_diff(min) < BITS {
            Inner::Bits(bits_of(min, values))
        } else {
            Inner::Set(Arc::new(values.to_vec()))
        };
        Domain { min, max, inner }
    }

    /// Those of `BITS` values from `min` on whose bits are set.
    #[inline]
    pub(super) fn of_bits(min: Value, bits: u64) -> Domain {
        if bits == 0 {
            return Domain::NONE;
        }
        let min = min + Value::from(bits.trailing_zeros());
        let bits = bits >> bits.trailing_zeros();
        Domain {
            min,
            max: min + Value::from(bits.ilog2()),
            inner: Inner::Bits(bits),
        }
    }

    /// The least value; above the greatest if there is none.
    #[inline]
    pub fn min(&self) -> Value {
        self.min
    }

    /// The greatest value.
    #[inline]
    pub fn max(&self) -> Value {
        self.max
    }

    /// From the least to the greatest.
    #[inline]
    pub fn span(&self) -> Span {
        Span::new(self.min, self.max)
    }

    /// Whether no value is in it.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.min > self.max
    }

    /// Its value, if it has exactly one.
    #[inline]
    pub fn value(&self) -> Option<Value> {
        (self.min == self.max).then_some(self.min)
    }

    /// How many values there are; `u64::MAX` if there are more.
    pub fn len(&self) -> u64 {
        match &self.inner {
            _ if self.is_empty() => 0,
            Inner::Interval => self.max.abs_diff(self.min).saturating_add(1),
            Inner::Bits(bits) => u64::from(bits.count_ones()),
            Inner::Set(values) => self.within(values).len() as u64,
        }
    }

    /// Whether a value is in it.
    #[inline]
    pub fn contains(&self, value: Value) -> bool {
        self.span().contains(value)
            && match &self.inner {
                Inner::Interval => true,
                Inner::Bits(bits) => bits >> value.abs_diff(self.min) & 1 == 1,
                Inner::Set(values) => values.binary_search(&value).is_ok(),
            }
    }

    /// All values, rising.
    pub fn values(&self) -> impl Iterator<Item = Value> + '_ {
        let listed = match &self.inner {
            Inner::Set(values) => self.within(values),
            _ => &[],
        };
        // Of a set, the span walks over nothing.
        let span = match &self.inner {
            Inner::Set(_) => Domain::NONE.span(),
            _ => self.span(),
        };
        let all = (span.min..=span.max).filter(|&value| self.contains(value));
        listed.iter().copied().chain(all)
    }

    /// What is in both.
    #[must_use]
    #[inline]
    pub fn intersect(&self, other: &Domain) -> Domain {
        match (&self.inner, &other.inner) {
            (Inner::Interval, _) => other.within_span(self.span()),
            (_, Inner::Interval) => self.within_span(other.span()),
            (Inner::Bits(a), Inner::Bits(b)) => {
                let both = self.span().intersect(other.span());
                if both.is_empty() {
                    return Domain::NONE;
                }
                let a = a >> both.min.abs_diff(self.min);
                let b = b >> both.min.abs_diff(other.min);
                Domain::of_bits(both.min, a & b)
            }
            (Inner::Set(values), _) => self.intersect_set(values, other),
            (_, Inner::Set(values)) => other.intersect_set(values, self),
        }
    }

    /// What is in a set, whose values these are, and in a domain that is no interval.
    fn intersect_set(&self, values: &Arc<Vec<Value>>, other: &Domain) -> Domain {
        match &other.inner {
            Inner::Bits(bits) => {
                let near = self.within_span(other.span());
                if near.is_empty() {
                    return Domain::NONE;
                }
                Domain::of_bits(other.min, bits & bits_of(other.min, near.within(values)))
            }
            Inner::Set(others) if !Arc::ptr_eq(values, others) => {
                self.intersect_sets(self.within(values), other, other.within(others))
            }
            _ => self.within_span(other.span()),
        }
    }

    /// What is in two sets; one of them as it is, if that is in the other.
    fn intersect_sets(&self, a: &[Value], other: &Domain, b: &[Value]) -> Domain {
        let (mut at, mut both) = (0, Vec::new());
        for &value in a {
            at += b[at..].partition_point(|&less| less < value);
            if b.get(at) == Some(&value) {
                both.push(value);
            }
        }
        if both.len() == a.len() {
            self.clone()
        } else if both.len() == b.len() {
            other.clone()
        } else {
            Domain::of_rising(&both)
        }
    }

    /// What is in it and in a span.
    #[must_use]
    #[inline]
    pub fn within_span(&self, span: Span) -> Domain {
        let both = self.span().intersect(span);
        if both.is_empty() {
            return Domain::NONE;
        }
        if both == self.span() {
            return self.clone();
        }
        match &self.inner {
            Inner::Interval => both.into(),
            Inner::Bits(bits) => {
                let low = bits >> both.min.abs_diff(self.min);
                Domain::of_bits(both.min, low & all_bits(both))
            }
            Inner::Set(values) => Domain::of_set_within(values, both),
        }
    }

    /// The values of a set that lie within a span.
    fn of_set_within(values: &Arc<Vec<Value>>, span: Span) -> Domain {
        let from = values.partition_point(|&value| value < span.min);
        let to = values.partition_point(|&value| value <= span.max);
        let some = &values[from..to];
        match (some.first(), some.last()) {
            (Some(&min), Some(&max)) if max.abs_diff(min) >= BITS => Domain {
                min,
                max,
                inner: Inner::Set(Arc::clone(values)),
            },
            _ => Domain::of_rising(some),
        }
    }

    /// All but one value; all, if that lies inside a wide interval.
    #[must_use]
    pub fn without(&self, value: Value) -> Domain {
        if !self.contains(value) {
            return self.clone();
        }
        if let Inner::Bits(bits) = self.inner {
            return Domain::of_bits(self.min, bits & !(1 << value.abs_diff(self.min)));
        }
        // What is wide has more than one value: its ends can be moved.
        if value == self.min {
            return self.within_span(Span::at_least(value + 1));
        }
        if value == self.max {
            return self.within_span(Span::at_most(value - 1));
        }
        match &self.inner {
            Inner::Set(values) => {
                let rest = self.within(values).iter().filter(|&&other| other != value);
                Domain::of_rising(&rest.copied().collect::<Vec<_>>())
            }
            _ => self.clone(),
        }
    }

    /// The bits of its values, if bits do for it.
    #[inline]
    pub(super) fn bits(&self) -> Option<u64> {
        match self.inner {
            Inner::Bits(bits) => Some(bits),
            _ => None,
        }
    }

    /// Whether it is a wide interval.
    #[inline]
    pub(super) fn is_interval(&self) -> bool {
        matches!(self.inner, Inner::Interval)
    }

    /// Those of its set that lie within its ends.
    fn within<'a>(&self, values: &'a [Value]) -> &'a [Value] {
        let from = values.partition_point(|&value| value < self.min);
        let to = values.partition_point(|&value| value <= self.max);
        &values[from..to]
    }
}

/// The bits of values that lie less than `BITS` above `min`.
fn bits_of(min: Value, values: &[Value]) -> u64 {
    let bit = |&value: &Value| 1 << value.abs_diff(min);
    values.iter().map(bit).fold(0, |all, bit: u64| all | bit)
}

/// As many bits as a span has values: 1 to `BITS`.
#[inline]
fn all_bits(span: Span) -> u64 {
    u64::MAX >> (BITS - 1 - span.max.abs_diff(span.min))
}

impl From<Span> for Domain {
    #[inline]
    fn from(span: Span) -> Domain {
        if span.is_empty() {
            return Domain::NONE;
        }
        let inner = if span.max.abs_diff(span.min) < BITS {
            Inner::Bits(all_bits(span))
        } else {
            Inner::Interval
        };
        let Span { min, max } = span;
        Domain { min, max, inner }
    }
}

impl From<&Values> for Domain {
    fn from(values: &Values) -> Domain {
        match values {
            Values::Truth => Span::new(0, 1).into(),
            Values::Numbers(span) => (*span).into(),
            Values::Symbols(symbols) => Domain::of(symbols.iter().copied()),
        }
    }
}

impl PartialEq for Domain {
    #[inline]
    fn eq(&self, other: &Domain) -> bool {
        self.span() == other.span()
            && match (&self.inner, &other.inner) {
                (Inner::Interval, Inner::Interval) => true,
                (Inner::Bits(a), Inner::Bits(b)) => a == b,
                (Inner::Set(a), Inner::Set(b)) => {
                    Arc::ptr_eq(a, b) || self.within(a) == other.within(b)
                }
                _ => false,
            }
    }
}

impl Eq for Domain {}

impl Hash for Domain {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.span().hash(state);
        match &self.inner {
            Inner::Interval => {}
            Inner::Bits(bits) => bits.hash(state),
            Inner::Set(values) => self.within(values).hash(state),
        }
    }
}

impl fmt::Debug for Domain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.inner {
            _ if self.is_empty() => f.write_str("{}"),
            _ if self.min == self.max => write!(f, "{}", self.min),
            Inner::Interval => self.span().fmt(f),
            Inner::Bits(bits) if *bits == all_bits(self.span()) => self.span().fmt(f),
            _ => f.debug_set().entries(self.values()).finish(),
        }
    }
}
