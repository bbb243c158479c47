//! By how much later one log was recorded than another, where nothing else says so.
//!
//! What says the same in both, and nothing else on its topic says, was at two times: their common difference
//! is the offset. Where too little says the same, as in measurements that never repeat, the offset is the
//! one by which most messages have one of the other log near them.

use std::collections::BTreeMap;

use super::aligning::nearest_to;
use super::entry::Entry;
use super::spill::{BUCKETS, Buckets};
use crate::LogError;

/// Differences of times that are kept of each topic.
const KEPT: usize = 1000;

/// Messages of a topic by which an offset is judged.
const JUDGED: usize = 500;

/// Offsets that are judged.
const CANDIDATES: usize = 64;

/// Below this, clocks are taken as one, and what is later is a difference.
const LEAST_NS: u64 = 100_000_000;

/// Of so many messages that say the same, the times decide.
const ENOUGH: usize = 8;

/// The offset of the second log, in nanoseconds; 0 if there is none that is sure.
pub(super) fn common_offset(
    a: &mut Buckets<Entry>,
    b: &mut Buckets<Entry>,
) -> Result<i64, LogError> {
    let mut apart = Vec::new();
    let mut candidates = vec![0];
    for bucket in 0..BUCKETS {
        for [xs, ys] in by_topic(&a.read(bucket)?, &b.read(bucket)?).values() {
            apart.extend(same_data(xs, ys));
            for (x, y) in [(xs.first(), ys.first()), (xs.last(), ys.last())] {
                if let (Some(x), Some(y)) = (x, y)
                    && candidates.len() < CANDIDATES
                {
                    candidates.push(difference(x, y));
                }
            }
        }
    }
    apart.sort_unstable();
    if let Some(middle) = apart.get(apart.len() / 2).copied() {
        let near = apart
            .iter()
            .filter(|one| one.abs_diff(middle) < LEAST_NS)
            .count();
        let sure = near * 5 >= apart.len() * 4 && apart.len() >= ENOUGH;
        if sure && middle.unsigned_abs() >= LEAST_NS {
            return Ok(middle);
        }
        if sure {
            return Ok(0);
        }
        candidates.push(middle);
    }
    candidates.retain(|one| *one == 0 || one.unsigned_abs() >= LEAST_NS);
    candidates.sort_unstable_by_key(|one| one.unsigned_abs());
    candidates.dedup();
    judge(a, b, &candidates)
}

/// Entries of both logs.
type Sides<'e> = [Vec<&'e Entry>; 2];

fn by_topic<'e>(a: &'e [Entry], b: &'e [Entry]) -> BTreeMap<u32, Sides<'e>> {
    let mut topics: BTreeMap<u32, Sides<'e>> = BTreeMap::new();
    for (side, entries) in [a, b].into_iter().enumerate() {
        for entry in entries {
            topics.entry(entry.topic).or_default()[side].push(entry);
        }
    }
    topics
}

fn difference(x: &Entry, y: &Entry) -> i64 {
    let apart = i128::from(y.time_ns) - i128::from(x.time_ns);
    apart.clamp(i64::MIN.into(), i64::MAX.into()) as i64
}

/// The differences in time of messages that say what no other on the topic says.
fn same_data(xs: &[&Entry], ys: &[&Entry]) -> Vec<i64> {
    let unique = |entries: &[&Entry]| {
        let mut found: BTreeMap<u64, Option<u64>> = BTreeMap::new();
        for entry in entries {
            let again = |known: &mut Option<u64>| *known = None;
            let first = || Some(entry.time_ns);
            found
                .entry(entry.identity)
                .and_modify(again)
                .or_insert_with(first);
        }
        found
    };
    let others = unique(ys);
    let each = unique(xs).into_iter().filter_map(|(data, x)| {
        let (x, y) = (x?, (*others.get(&data)?)?);
        let apart = i128::from(y) - i128::from(x);
        Some(apart.clamp(i64::MIN.into(), i64::MAX.into()) as i64)
    });
    each.take(KEPT).collect()
}

/// The offset by which messages are nearest to those of the other log, if it is much better than none.
fn judge(
    a: &mut Buckets<Entry>,
    b: &mut Buckets<Entry>,
    candidates: &[i64],
) -> Result<i64, LogError> {
    let mut costs = vec![0.0; candidates.len()];
    let mut judged = 0usize;
    for bucket in 0..BUCKETS {
        for [xs, ys] in by_topic(&a.read(bucket)?, &b.read(bucket)?).values() {
            let mut times: Vec<(u64, u32)> = ys.iter().map(|y| (y.time_ns, y.at)).collect();
            times.sort_unstable();
            let Some(half_period) = half_period(&times) else {
                continue;
            };
            let step = xs.len().div_ceil(JUDGED).max(1);
            for x in xs.iter().step_by(step) {
                judged += 1;
                for (cost, offset) in costs.iter_mut().zip(candidates) {
                    let time = x.time_ns.saturating_add_signed(*offset);
                    let nearest = nearest_to(time, &times).map_or(u64::MAX, |at| times[at].0);
                    *cost += (nearest.abs_diff(time) as f64 / half_period).min(1.0);
                }
            }
        }
    }
    let best = (0..costs.len()).min_by(|x, y| costs[*x].total_cmp(&costs[*y]));
    let (Some(best), Some(none)) = (best, candidates.iter().position(|offset| *offset == 0)) else {
        return Ok(0);
    };
    // By chance one in two is as near.
    let sure = judged >= ENOUGH && costs[best] < 0.25 * judged as f64;
    let better = costs[best] < 0.5 * costs[none];
    Ok(if sure && better { candidates[best] } else { 0 })
}

/// Half of the time that mostly is between two messages, in nanoseconds; none of too few.
fn half_period(times: &[(u64, u32)]) -> Option<f64> {
    let mut apart: Vec<u64> = times.windows(2).map(|two| two[1].0 - two[0].0).collect();
    apart.sort_unstable();
    let middle = *apart.get(apart.len() / 2)?;
    (middle > 0).then_some(middle as f64 / 2.0)
}
