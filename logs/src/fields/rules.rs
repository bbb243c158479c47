//! By how much values may differ, and which are not compared.

use super::Path;

/// By how much something may differ and still be the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// A number: absolutely, or as a share of the larger one.
    Number(f64),
    /// A time, in nanoseconds.
    TimeNs(u64),
}

/// What holds for one part of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bound {
    /// What numbers may differ by, absolutely or as a share.
    pub(crate) number: f64,
    /// What times may differ by.
    pub(crate) time_ns: u64,
    /// The field, or one around it, was named: integers may differ too.
    pub(crate) own: bool,
}

/// What was said about fields by their names, and about all.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rules {
    tolerance: f64,
    time_ns: u64,
    within: Vec<(Vec<String>, Tolerance)>,
    ignored: Vec<Vec<String>>,
    /// By how much later the second log was recorded.
    pub(crate) offset_ns: i64,
}

/// The names of a path: `header.stamp`.
fn steps(path: &str) -> Vec<String> {
    path.split('.').map(str::to_owned).collect()
}

impl Rules {
    /// All numbers may differ by the tolerance, and times by as much if there is none for them.
    pub(crate) fn new(tolerance: f64, time_ns: Option<u64>) -> Self {
        Rules {
            tolerance,
            // A float that is too large becomes the largest integer.
            time_ns: time_ns.unwrap_or((tolerance * 1e9) as u64),
            ..Rules::default()
        }
    }

    /// What a field may differ by, and all within it.
    pub(crate) fn within(&mut self, field: &str, tolerance: Tolerance) {
        self.within.push((steps(field), tolerance));
    }

    /// A field is not compared, nor what is within it.
    pub(crate) fn ignore(&mut self, field: &str) {
        self.ignored.push(steps(field));
    }

    /// Whether nothing but what is equal is the same.
    pub(crate) fn are_exact(&self) -> bool {
        self.tolerance <= 0.0 && self.time_ns == 0 && !self.name_fields() && self.offset_ns == 0
    }

    /// Whether fields are named.
    pub(crate) fn name_fields(&self) -> bool {
        !(self.within.is_empty() && self.ignored.is_empty())
    }

    /// All fields that are named.
    pub(crate) fn named(&self) -> impl Iterator<Item = String> {
        let within = self.within.iter().map(|(steps, _)| steps);
        within.chain(&self.ignored).map(|steps| steps.join("."))
    }

    /// What holds where no field was named.
    pub(crate) fn bound(&self) -> Bound {
        Bound {
            number: self.tolerance,
            time_ns: self.time_ns,
            own: false,
        }
    }

    /// What holds for a part, by what holds around it; none if it is not compared.
    pub(crate) fn enter(&self, path: &Path<'_>, around: Bound) -> Option<Bound> {
        if !self.name_fields() {
            return Some(around);
        }
        if self.ignored.iter().any(|steps| path.is(steps)) {
            return None;
        }
        let own = self.within.iter().rev().find(|(steps, _)| path.is(steps));
        Some(match own {
            None => around,
            Some((_, Tolerance::Number(number))) => Bound {
                number: *number,
                time_ns: (*number * 1e9) as u64,
                own: true,
            },
            Some((_, Tolerance::TimeNs(time_ns))) => Bound {
                // Times may be written as numbers of seconds, too.
                number: *time_ns as f64 / 1e9,
                time_ns: *time_ns,
                own: true,
            },
        })
    }

    /// What holds for a part that is no field of the message: `log_time`; none if it is not compared.
    pub(crate) fn enter_root(&self, name: &str) -> Option<Bound> {
        self.enter(&Path::Root(name), self.bound())
    }

    /// Whether two times are the same, or within their bound as they are or after the common offset.
    pub(crate) fn times_agree(&self, a: i128, b: i128, bound: Bound) -> bool {
        let within = |b: i128| a.abs_diff(b) <= u128::from(bound.time_ns);
        a == b || (bound.time_ns > 0 && (within(b) || within(b - i128::from(self.offset_ns))))
    }

    /// Whether two times of messages agree after the common offset.
    pub(crate) fn log_times_agree(&self, a_ns: u64, b_ns: u64, bound: Bound) -> bool {
        let b = i128::from(b_ns) - i128::from(self.offset_ns);
        i128::from(a_ns).abs_diff(b) <= u128::from(bound.time_ns)
    }
}
