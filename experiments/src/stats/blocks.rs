//! Blocks: which values vary by chance together.

use super::finite_sorted;

/// Values in blocks. A block is what a bootstrap draws and what a test counts: the runs that share
/// a problem, or a run alone. Five runs on one problem are no five witnesses of what other problems
/// would say.
///
/// Values that are no finite numbers are left out, and so are blocks without any. The order of
/// blocks, and of values within them, says nothing.
///
/// ```
/// use farside_experiments::stats::Blocks;
/// let alone = Blocks::from(&[1.0, 2.0, 3.0]);
/// let shared = Blocks::from(vec![vec![3.0, 1.0], vec![2.0, f64::NAN], vec![]]);
/// assert_eq!((alone.count(), shared.count()), (3, 2));
/// assert_eq!(shared.means(), [2.0, 2.0]);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Blocks(Vec<Vec<f64>>);

impl From<Vec<Vec<f64>>> for Blocks {
    fn from(blocks: Vec<Vec<f64>>) -> Self {
        let sorted = blocks.iter().map(|block| finite_sorted(block));
        let mut blocks: Vec<Vec<f64>> = sorted.filter(|block| !block.is_empty()).collect();
        blocks.sort_by(|a, b| {
            let pairs = a.iter().zip(b);
            let apart = pairs.map(|(a, b)| a.total_cmp(b));
            apart
                .fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
                .then(a.len().cmp(&b.len()))
        });
        Blocks(blocks)
    }
}

/// Each value alone.
impl From<&[f64]> for Blocks {
    fn from(values: &[f64]) -> Self {
        let alone: Vec<Vec<f64>> = values.iter().map(|value| vec![*value]).collect();
        alone.into()
    }
}

impl<const N: usize> From<&[f64; N]> for Blocks {
    fn from(values: &[f64; N]) -> Self {
        values.as_slice().into()
    }
}

impl From<&Vec<f64>> for Blocks {
    fn from(values: &Vec<f64>) -> Self {
        values.as_slice().into()
    }
}

impl Blocks {
    /// How many blocks there are.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// The mean of each block.
    pub fn means(&self) -> Vec<f64> {
        let mean = |block: &Vec<f64>| block.iter().sum::<f64>() / block.len() as f64;
        self.0.iter().map(mean).collect()
    }
}

/// The blocks of one or several groups, ready to be drawn: all values together, least first, and
/// where each block's values are among them. So a redrawn pool is sorted by counting.
pub(super) struct Pool {
    pub(super) sorted: Vec<f64>,
    /// By group, by block.
    pub(super) places: Vec<Vec<Vec<usize>>>,
}

impl Pool {
    pub(super) fn new(groups: &[&Blocks]) -> Self {
        let mut tagged: Vec<(f64, usize, usize)> = Vec::new();
        for (group, blocks) in groups.iter().enumerate() {
            for (block, values) in blocks.0.iter().enumerate() {
                tagged.extend(values.iter().map(|value| (*value, group, block)));
            }
        }
        tagged.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut places: Vec<Vec<Vec<usize>>> = groups
            .iter()
            .map(|blocks| vec![Vec::new(); blocks.count()])
            .collect();
        for (place, (_, group, block)) in tagged.iter().enumerate() {
            places[*group][*block].push(place);
        }
        Pool {
            sorted: tagged.into_iter().map(|(value, ..)| value).collect(),
            places,
        }
    }

    /// Draws one group's blocks anew, counts what was drawn of each value, and returns the mean.
    pub(super) fn draw(
        &self,
        group: usize,
        stream: &mut farside::random::Stream,
        drawn: &mut [u32],
    ) -> f64 {
        let blocks = &self.places[group];
        let (mut sum, mut count) = (0.0, 0u32);
        for _ in 0..blocks.len() {
            for place in &blocks[stream.below(blocks.len() as u64) as usize] {
                drawn[*place] += 1;
                sum += self.sorted[*place];
                count += 1;
            }
        }
        sum / f64::from(count)
    }
}
