//! What comes out of the queue, and in which order.

use proptest::prelude::*;

use super::*;

fn entry(time: u64, step: u32, source: u32, count: u64) -> Entry {
    let key = EventKey {
        time: SimTime::from_nanos(time),
        step,
        tie: 0,
        source: EntityId(source),
        count,
    };
    Entry::new(key, 0)
}

/// Handles events until none is left; each pushes what `pushes` says next: a delay, its source.
fn in_key_order(
    start: impl IntoIterator<Item = (u64, u32)>,
    pushes: impl IntoIterator<Item = (u64, u32)>,
    windows: bool,
    drop_one_in: u64,
) -> Result<(), TestCaseError> {
    let mut queue = Queue::default();
    let (mut count, mut dropped) = (0, 0);
    for (time, source) in start {
        count += 1;
        queue.push(entry(time, 0, source, count));
    }
    let mut pushes = pushes.into_iter();
    let mut last: Option<EventKey> = None;
    let mut taken = 0;
    while let Some(head) = queue.peek() {
        let bound = match windows {
            true => Bound {
                time: head.time,
                step: head.step + 1,
            },
            false => Bound::NEVER,
        };
        while let Some(popped) = queue.pop_before(bound) {
            prop_assert!(popped.bound() < bound);
            prop_assert!(last.is_none_or(|last| last < popped.key()));
            last = Some(popped.key());
            taken += 1;
            if let Some((delay, source)) = pushes.next() {
                count += 1;
                let (now, is_now) = (popped.bound(), delay == 0);
                let step = if is_now { now.step + 1 } else { 0 };
                queue.push(entry(now.time.as_nanos() + delay, step, source, count));
            }
            if drop_one_in > 0 && taken == count / 2 {
                queue.retain(|entry| {
                    let kept = entry.count % drop_one_in != 0;
                    dropped += u64::from(!kept);
                    kept
                });
            }
        }
    }
    prop_assert_eq!(taken + dropped, count);
    Ok(())
}

proptest! {
    /// Whatever handlers push, at this instant or later, and wherever a window ends, events come
    /// out in key order and none is lost.
    #[test]
    fn pops_in_key_order(
        start in prop::collection::vec((0u64..4, 0u32..5), 1..120),
        pushes in prop::collection::vec((0u64..90, 0u32..5), 0..400),
        windows in any::<bool>(),
    ) {
        // One in three at once, the others near and far.
        let pushes = pushes.into_iter().map(|(delay, source)| (delay.saturating_sub(30), source));
        in_key_order(start, pushes, windows, 0)?;
    }

    /// The same where very many wait: spread over all of time, in crowds at single instants, and
    /// with some that are far later than all others.
    #[test]
    fn many_pop_in_key_order(
        seed in any::<u64>(),
        many in 1usize..12_000,
        log_span in 0u32..60,
        crowd in 1u64..1_000,
        drop_one_in in 0u64..4,
        windows in any::<bool>(),
    ) {
        let mut state = seed | 1;
        let mut draw = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        };
        let mut delay = move || {
            let span = match draw() % 16 {
                0 => 1u64 << (log_span / 4),
                1 => 1u64 << log_span.min(50),
                2 => 1,
                _ => 1u64 << (log_span / 2),
            };
            (draw() % span / crowd * crowd, (draw() % 7) as u32)
        };
        let start: Vec<_> = (0..many).map(|_| delay()).collect();
        let pushes: Vec<_> = (0..2 * many).map(|_| delay()).collect();
        in_key_order(start, pushes, windows, drop_one_in)?;
    }
}

proptest! {
    /// Near the end of the clock too, where delays that would pass it stop at its last instant, which
    /// is never reached: what is there is left.
    #[test]
    fn the_last_of_all_times_pop_in_key_order(
        start in prop::collection::vec(late(), 1..400),
        pushes in prop::collection::vec(late(), 0..800),
        crowd in 0usize..300,
    ) {
        let end = Bound::at(SimTime::MAX);
        let mut queue = Queue::default();
        let mut count = 0;
        let crowded = std::iter::repeat_n(u64::MAX, crowd);
        for time in start.into_iter().chain(crowded) {
            count += 1;
            queue.push(entry(time, 0, 0, count));
        }
        let mut last: Option<EventKey> = None;
        let mut taken = 0;
        let mut pushes = pushes.into_iter();
        while let Some(popped) = queue.pop_before(end) {
            prop_assert!(last.is_none_or(|last| last < popped.key()));
            last = Some(popped.key());
            taken += 1;
            if let Some(delay) = pushes.next() {
                count += 1;
                let time = popped.key().time.as_nanos().saturating_add(delay.max(1));
                queue.push(entry(time, 0, 0, count));
            }
        }
        let left = queue.drain_sorted();
        prop_assert!(left.iter().all(|entry| entry.key().time == SimTime::MAX));
        prop_assert_eq!(taken + left.len() as u64, count);
    }
}

/// Any time, mostly a short one, the last, or the last but one.
fn late() -> impl Strategy<Value = u64> {
    prop_oneof![
        0u64..1_000,
        any::<u64>(),
        u64::MAX - 1_000..=u64::MAX,
        u64::MAX - 1..=u64::MAX,
    ]
}

/// What is left at the end is everything, in key order, wherever it waited.
#[test]
fn everything_left_is_drained_in_key_order() {
    let mut queue = Queue::default();
    for count in 0..20_000u64 {
        let time = (count * 2_654_435_761) % 1_000_003;
        queue.push(entry(time, 0, 0, count));
    }
    let taken = (0..5_000)
        .filter_map(|_| queue.pop_before(Bound::NEVER))
        .count();
    let rest = queue.drain_sorted();
    assert_eq!(taken + rest.len(), 20_000);
    assert!(rest.is_sorted_by(|a, b| a.key() < b.key()));
}

/// Cancelled timers may empty the buckets while events before their horizon go on waiting.
#[test]
fn buckets_that_were_emptied_begin_anew() {
    let mut queue = Queue::default();
    for count in 0..5_000 {
        queue.push(entry(1_000 + count * 1_000, 0, 0, count));
    }
    for _ in 0..60 {
        queue.pop_before(Bound::NEVER);
    }
    queue.retain(|_| false);
    for count in 5_000..9_000 {
        let time = 70_000 + (count * 7_919) % 4_001;
        queue.push(entry(time, 0, 0, count));
    }
    let mut popped = Vec::new();
    while let Some(entry) = queue.pop_before(Bound::NEVER) {
        popped.push(entry.key());
    }
    assert_eq!(popped.len(), 4_000);
    assert!(popped.is_sorted());
}
