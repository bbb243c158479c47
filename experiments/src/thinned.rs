//! Values over time, thinned to what can be shown: of each short time the first, the least, the greatest and the last.

/// A curve of any length in bounded memory.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Thinned {
    /// Times in nanoseconds and values.
    pub(crate) points: Vec<(u64, f64)>,
    /// How many values there were.
    pub(crate) values: u64,
    /// The least and the greatest finite value.
    pub(crate) range: Option<[f64; 2]>,
    /// As many points as there are after thinning; before it four times as many.
    most: usize,
    /// Values stand for a time of this length each, once there are too many.
    width_ns: u64,
}

impl Thinned {
    /// A curve of about so many points, at most four times as many.
    pub(crate) fn to(most: usize) -> Thinned {
        Thinned {
            points: Vec::new(),
            values: 0,
            range: None,
            most: most.max(4),
            width_ns: 0,
        }
    }

    /// Adds a value, later than those before it.
    pub(crate) fn push(&mut self, time_ns: u64, value: f64) {
        self.values += 1;
        if value.is_finite() {
            let [least, greatest] = self.range.unwrap_or([value; 2]);
            self.range = Some([least.min(value), greatest.max(value)]);
        }
        self.points.push((time_ns, value));
        if self.points.len() >= 4 * self.most {
            self.thin();
        }
    }

    /// Its points, as close to each other at its end as at its beginning.
    pub(crate) fn evenly(&self) -> Vec<(u64, f64)> {
        let mut even = self.clone();
        if self.width_ns > 0 {
            even.thin();
        }
        even.points
    }

    fn thin(&mut self) {
        let times = self.points.iter().map(|(time_ns, _)| *time_ns);
        let (from, until) = (times.clone().min().unwrap_or(0), times.max().unwrap_or(0));
        self.width_ns = ((until - from) / (self.most as u64 / 4) + 1).max(self.width_ns);
        let width_ns = self.width_ns;
        let mut kept: Vec<(u64, f64)> = Vec::new();
        for group in self
            .points
            .chunk_by(|a, b| a.0 / width_ns == b.0 / width_ns)
        {
            let order = |a: &&(u64, f64), b: &&(u64, f64)| a.1.total_cmp(&b.1);
            let ends = [group.first(), group.last()];
            let extremes = [group.iter().min_by(order), group.iter().max_by(order)];
            let mut some: Vec<(u64, f64)> = ends
                .into_iter()
                .chain(extremes)
                .flatten()
                .copied()
                .collect();
            some.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            some.dedup_by(|a, b| a.0 == b.0 && a.1.to_bits() == b.1.to_bits());
            kept.append(&mut some);
        }
        self.points = kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinned_curves_keep_their_extremes_and_ends() {
        const POINTS: usize = 4096;
        let mut curve = Thinned::to(POINTS);
        let value = |at: u64| if at == 54_321 { 99.0 } else { (at % 17) as f64 };
        for at in 0..100_000 {
            curve.push(at * 1_000, value(at));
        }
        assert!(curve.points.len() < 4 * POINTS, "{}", curve.points.len());
        assert_eq!(curve.values, 100_000);
        assert_eq!(curve.range, Some([0.0, 99.0]));
        assert!(curve.points.contains(&(54_321_000, 99.0)));
        let even = curve.evenly();
        let half = even.partition_point(|(time_ns, _)| *time_ns < 50_000_000);
        assert!(
            half.abs_diff(even.len() - half) < even.len() / 10,
            "{half} of {}",
            even.len()
        );
        assert!(even.contains(&(54_321_000, 99.0)));
        assert_eq!(curve.points[0], (0, 0.0));
        assert_eq!(curve.points.last(), Some(&(99_999_000, value(99_999))));
        assert!(curve.points.is_sorted_by_key(|(time_ns, _)| *time_ns));
    }
}
