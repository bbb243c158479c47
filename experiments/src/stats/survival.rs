//! When something happens, if some runs end before it does.

use std::collections::BTreeMap;

use super::{Estimate, Z_95};

/// One thing that was watched: a rover until it arrived, or until nobody watched any more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// When it happened, or until when it was watched; infinite for what never happens.
    pub time: f64,
    /// It happened at `time`; if not, it is censored there.
    pub happened: bool,
    /// What it shares its fate with: rovers of one run succeed and fail together, so a run is what
    /// varies by chance, not a rover.
    pub group: usize,
}

/// What is known just after a time at which something happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The time.
    pub time: f64,
    /// How many were watched until then and to which it had not happened.
    pub at_risk: usize,
    /// To how many it happened.
    pub happened: usize,
    /// The share to which it has not happened, with its interval.
    pub remaining: Estimate,
}

/// A Kaplan-Meier curve: the share to which it has not happened yet, over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Survival {
    /// One step for each time at which it happened, in order.
    pub steps: Vec<Step>,
    /// How many were watched.
    pub watched: usize,
    /// To how many it happened.
    pub happened: usize,
    /// Until when any was watched: the last finite time, 0 if there is none.
    pub until: f64,
}

/// Estimates the curve (Kaplan and Meier, *Nonparametric Estimation from Incomplete Observations*,
/// 1958). What is censored at a time at which it happens to another counts as watched then.
///
/// The variance of the curve's logarithm sums the squared influence of each group, which is
/// Greenwood's formula if every group is of one (Greenwood 1926; Williams, *Product-Limit Survival
/// Functions with Correlated Survival Times*, 1995); the interval is laid over log(-log), so that
/// it stays within 0 and 1 (Kalbfleisch and Prentice, 1980). Before anything happens it has no
/// width. At 0 the formula says nothing, and the upper end stays where it was. With one group of
/// several, nothing says how groups differ, and the interval is from 0 to 1.
///
/// Observations whose time is not a number, or below 0, are left out.
///
/// ```
/// use farside_experiments::stats::survival::{kaplan_meier, Observation};
/// let rover = |group, time, happened| Observation { time, happened, group };
/// // The third was still under way when its run's time was over.
/// let curve = kaplan_meier(&[rover(0, 4.0, true), rover(1, 6.0, true), rover(2, 5.0, false)]);
/// assert!((curve.at(4.5).value - 2.0 / 3.0).abs() < 1e-12);
/// assert_eq!(curve.median().value, 6.0);
/// ```
pub fn kaplan_meier(observations: &[Observation]) -> Survival {
    let mut sorted: Vec<Observation> = observations.to_vec();
    sorted.retain(|observation| observation.time >= 0.0);
    sorted.sort_by(|a, b| a.time.total_cmp(&b.time).then(b.happened.cmp(&a.happened)));
    let mut groups = Groups::new(&sorted);
    let mut survival = Survival {
        steps: Vec::new(),
        watched: sorted.len(),
        happened: sorted.iter().filter(|one| one.happened).count(),
        until: 0.0,
    };
    let mut at_risk = sorted.len();
    let mut remaining = 1.0;
    let mut upper = 1.0;
    let mut rest = sorted.as_slice();
    while let Some(first) = rest.first() {
        let same_time = rest.partition_point(|one| one.time <= first.time);
        let (now, later) = rest.split_at(same_time);
        let happened = now.partition_point(|one| one.happened);
        if happened > 0 {
            remaining *= (at_risk - happened) as f64 / at_risk as f64;
            groups.account(now, at_risk, happened);
            let share = groups.interval(remaining, upper);
            upper = share.high;
            survival.steps.push(Step {
                time: first.time,
                at_risk,
                happened,
                remaining: share,
            });
        }
        if first.time.is_finite() {
            survival.until = first.time;
        }
        groups.leave(now);
        at_risk -= now.len();
        rest = later;
    }
    survival
}

/// What each group contributes to the logarithm of the curve, and how many of it are watched.
struct Groups {
    /// The place of each group in the vectors.
    places: BTreeMap<usize, usize>,
    watched: Vec<f64>,
    influence: Vec<f64>,
    singles: bool,
}

impl Groups {
    fn new(observations: &[Observation]) -> Self {
        let mut places = BTreeMap::new();
        let mut watched = Vec::new();
        for one in observations {
            let place = *places.entry(one.group).or_insert(watched.len());
            if place == watched.len() {
                watched.push(0.0);
            }
            watched[place] += 1.0;
        }
        Groups {
            places,
            influence: vec![0.0; watched.len()],
            singles: watched.iter().all(|count| *count == 1.0),
            watched,
        }
    }

    fn account(&mut self, now: &[Observation], at_risk: usize, happened: usize) {
        if at_risk == happened {
            return;
        }
        let scale = 1.0 / (at_risk - happened) as f64;
        let hazard = happened as f64 / at_risk as f64;
        for (influence, watched) in self.influence.iter_mut().zip(&self.watched) {
            *influence += watched * hazard * scale;
        }
        for one in &now[..happened] {
            self.influence[self.places[&one.group]] -= scale;
        }
    }

    fn leave(&mut self, now: &[Observation]) {
        for one in now {
            self.watched[self.places[&one.group]] -= 1.0;
        }
    }

    fn interval(&self, remaining: f64, upper_before: f64) -> Estimate {
        let estimate = |low: f64, high: f64| Estimate {
            value: remaining,
            low: low.min(remaining),
            high: high.max(remaining),
        };
        if self.influence.len() < 2 && !self.singles {
            return estimate(0.0, 1.0);
        }
        if remaining <= 0.0 {
            return estimate(0.0, upper_before);
        }
        let variance: f64 = self.influence.iter().map(|value| value * value).sum();
        let log = libm::log(remaining);
        let reach = libm::exp(Z_95 * libm::sqrt(variance) / log.abs());
        estimate(libm::exp(log * reach), libm::exp(log / reach))
    }
}

impl Survival {
    /// The share to which it has not happened at `time`, with its interval.
    pub fn at(&self, time: f64) -> Estimate {
        let passed = self.steps.partition_point(|step| step.time <= time);
        let last = passed.checked_sub(1).map(|at| self.steps[at].remaining);
        last.unwrap_or(Estimate {
            value: 1.0,
            low: 1.0,
            high: 1.0,
        })
    }

    /// When it has happened to a share `q`; infinite if that is never seen, not a number if nothing
    /// was watched.
    pub fn quantile(&self, q: f64) -> f64 {
        self.first(|share| share.value, 1.0 - q)
    }

    /// When it has happened to half; infinite if that is never seen. The interval reaches over the
    /// times at which the curve's interval holds one half (Brookmeyer and Crowley 1982).
    pub fn median(&self) -> Estimate {
        if self.watched == 0 {
            return Estimate::unknown(f64::NAN);
        }
        Estimate {
            value: self.quantile(0.5),
            low: self.first(|share| share.low, 0.5),
            high: self.first(|share| share.high, 0.5),
        }
    }

    /// The first time at which what remains, or an end of its interval, is down to a share.
    fn first(&self, remaining: impl Fn(&Estimate) -> f64, share: f64) -> f64 {
        if self.watched == 0 {
            return f64::NAN;
        }
        // The curve is a product: a half may come out as a rounding more.
        let down = |step: &&Step| remaining(&step.remaining) <= share + 1e-12;
        let step = self.steps.iter().find(down);
        step.map_or(f64::INFINITY, |step| step.time)
    }
}
