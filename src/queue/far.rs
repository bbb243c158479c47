//! Events far ahead: thrown into buckets by time, unsorted, and handed on when their turn comes.
//!
//! A ladder queue (W. T. Tang, R. S. M. Goh and I. L.-J. Thng, "Ladder Queue: An O(1) Priority Queue
//! Structure for Large-Scale Discrete Event Simulation", ACM TOMACS 15(3), 2005) without its bottom,
//! which the caller has. An event is moved a few times, however many wait, and each move writes to
//! the end of a list, where a heap reads and writes half a dozen distant lines of cache.

use prefetch_index::prefetch_index;

use super::Entry;
use crate::time::SimTime;

/// How many events a bucket is meant to hold.
const PER_BUCKET: usize = 12;

/// The most buckets of a rung: their heads and last lines are to stay in a cache.
const MOST_BUCKETS: usize = 1 << 13;

/// A bucket with more events than this is spread over a rung of its own.
const CROWDED: usize = 8 * PER_BUCKET;

/// So many rungs take any distribution apart: each divides a bucket's span by its buckets.
const MOST_RUNGS: usize = 8;

/// Buckets of equal width, one after the other in time.
#[derive(Default)]
struct Rung {
    /// Where the first bucket begins \[ns\].
    start_ns: u64,
    /// A bucket is two to the power of this wide \[ns\].
    shift: u32,
    /// The bucket whose turn is next; those before it are empty.
    next: usize,
    /// How many buckets there are now; others are kept for their memory.
    used: usize,
    buckets: Vec<Vec<Entry>>,
}

impl Rung {
    /// Spreads entries whose times lie between these two, both included.
    fn fill(&mut self, entries: &mut Vec<Entry>, first_ns: u64, last_ns: u64) {
        let span_ns = last_ns - first_ns;
        let wanted = (entries.len() / PER_BUCKET).clamp(1, MOST_BUCKETS) as u64;
        self.start_ns = first_ns;
        self.next = 0;
        // A bucket as wide as all of time could not be counted in 64 bits: two then do.
        let log = (span_ns / wanted).checked_ilog2();
        self.shift = log.map_or(0, |log| (log + 1).min(u64::BITS - 1));
        self.used = (span_ns >> self.shift) as usize + 1;
        if self.buckets.len() < self.used {
            self.buckets.resize_with(self.used, Vec::new);
        }
        for entry in entries.drain(..) {
            let at = self.bucket_of(entry.time);
            self.buckets[at].push(entry);
        }
    }

    #[inline]
    fn bucket_of(&self, time: SimTime) -> usize {
        ((time.as_nanos() - self.start_ns) >> self.shift) as usize
    }

    /// Where the last bucket ends \[ns\], as far as time goes.
    fn end_ns(&self) -> u64 {
        let end = u128::from(self.start_ns) + ((self.used as u128) << self.shift);
        u64::try_from(end).unwrap_or(u64::MAX)
    }

    /// Where the bucket whose turn is next begins \[ns\].
    fn next_ns(&self) -> u64 {
        let begin = u128::from(self.start_ns) + ((self.next as u128) << self.shift);
        u64::try_from(begin).unwrap_or(u64::MAX)
    }
}

/// Events that come at [`Far::horizon_ns`] or later.
pub(super) struct Far {
    /// From the coarsest to the finest; each but the first divides the bucket of the one before
    /// whose turn it was.
    rungs: Vec<Rung>,
    /// Rungs that are used up, for their memory.
    spare: Vec<Rung>,
    /// Later than all rungs.
    beyond: Vec<Entry>,
    /// Where `beyond` begins \[ns\].
    beyond_ns: u64,
    /// The least and the greatest time in `beyond` \[ns\].
    least_ns: u64,
    greatest_ns: u64,
    horizon_ns: u64,
    len: usize,
}

impl Default for Far {
    fn default() -> Self {
        Far {
            rungs: Vec::new(),
            spare: Vec::new(),
            beyond: Vec::new(),
            beyond_ns: u64::MAX,
            least_ns: u64::MAX,
            greatest_ns: 0,
            horizon_ns: u64::MAX,
            len: 0,
        }
    }
}

impl Far {
    pub(super) fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Events before this are the caller's. Without events here there is no horizon.
    #[inline(always)]
    pub(super) fn horizon_ns(&self) -> u64 {
        self.horizon_ns
    }

    /// From now on takes what comes at this time or later.
    pub(super) fn begin(&mut self, horizon_ns: u64) {
        debug_assert!(self.is_empty() && self.rungs.is_empty());
        (self.horizon_ns, self.beyond_ns) = (horizon_ns, horizon_ns);
    }

    /// Takes an event that does not come before the horizon.
    #[inline]
    pub(super) fn push(&mut self, entry: Entry) {
        self.len += 1;
        let time_ns = entry.time.as_nanos();
        if time_ns >= self.beyond_ns {
            self.least_ns = self.least_ns.min(time_ns);
            self.greatest_ns = self.greatest_ns.max(time_ns);
            self.beyond.push(entry);
            return;
        }
        // The finest rung that reaches so far, nearly always the only one. A coarser one's buckets
        // up to there had their turn.
        for rung in self.rungs.iter_mut().rev() {
            let at = rung.bucket_of(entry.time);
            if at < rung.used {
                rung.buckets[at].push(entry);
                return;
            }
        }
        unreachable!("what comes before `beyond` lies in the coarsest rung");
    }

    /// Fetches the end of the bucket that [`Far::push`] would put an entry in. Those of the coarsest
    /// rung lie far apart; the others' are few.
    #[inline(always)]
    pub(super) fn fetch(&self, entry: &Entry) {
        let time_ns = entry.time.as_nanos();
        let coarsest = self.rungs.first();
        let rung = coarsest.filter(|rung| (rung.start_ns..self.beyond_ns).contains(&time_ns));
        if let Some(bucket) = rung.and_then(|rung| rung.buckets.get(rung.bucket_of(entry.time))) {
            prefetch_index(bucket, bucket.len());
        }
    }

    /// Appends the events of the next bucket that has any to `out`, in no order.
    pub(super) fn take_next(&mut self, out: &mut Vec<Entry>) {
        while self.len > 0 {
            let may_divide = self.rungs.len() < MOST_RUNGS;
            let Some(rung) = self.rungs.last_mut() else {
                self.divide_beyond();
                continue;
            };
            let rest = &rung.buckets[rung.next..rung.used];
            let Some(ahead) = rest.iter().position(|bucket| !bucket.is_empty()) else {
                let empty = self.rungs.pop();
                self.spare.extend(empty);
                continue;
            };
            rung.next += ahead + 1;
            self.horizon_ns = rung.next_ns();
            let can_be_divided = may_divide && rung.shift > 0;
            let bucket = &mut rung.buckets[rung.next - 1];
            if bucket.len() > CROWDED && can_be_divided {
                self.divide_bucket();
                continue;
            }
            self.len -= bucket.len();
            out.append(bucket);
            break;
        }
        self.end_if_empty();
    }

    /// Without events there is no horizon.
    pub(super) fn end_if_empty(&mut self) {
        if self.len == 0 {
            self.spare.append(&mut self.rungs);
            (self.horizon_ns, self.beyond_ns) = (u64::MAX, u64::MAX);
        }
    }

    fn divide_beyond(&mut self) {
        let mut rung = self.spare.pop().unwrap_or_default();
        rung.fill(&mut self.beyond, self.least_ns, self.greatest_ns);
        self.beyond_ns = rung.end_ns();
        (self.least_ns, self.greatest_ns) = (u64::MAX, 0);
        self.rungs.push(rung);
    }

    /// Divides the bucket whose turn it was, all of its time.
    fn divide_bucket(&mut self) {
        let mut finer = self.spare.pop().unwrap_or_default();
        if let Some(rung) = self.rungs.last_mut() {
            let at = rung.next - 1;
            let begin_ns = rung.start_ns + ((at as u64) << rung.shift);
            // The last bucket ends where time does.
            let last_ns = begin_ns.saturating_add((1u64 << rung.shift) - 1);
            finer.fill(&mut rung.buckets[at], begin_ns, last_ns);
        }
        self.rungs.push(finer);
    }

    /// Keeps the entries that `keep` accepts.
    pub(super) fn retain(&mut self, mut keep: impl FnMut(&Entry) -> bool) {
        let buckets = self.rungs.iter_mut().flat_map(|rung| &mut rung.buckets);
        for bucket in buckets.chain([&mut self.beyond]) {
            let before = bucket.len();
            bucket.retain(&mut keep);
            self.len -= before - bucket.len();
        }
        self.end_if_empty();
    }

    /// Everything, in no order.
    pub(super) fn drain(&mut self) -> impl Iterator<Item = Entry> {
        let all = std::mem::take(self);
        let buckets = all.rungs.into_iter().flat_map(|rung| rung.buckets);
        buckets.flatten().chain(all.beyond)
    }
}
