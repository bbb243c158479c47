//! What is left of a scenario while it is made small, and the steps that leave out more.

use farside::SimDuration;
use toml::{Table, Value};

use super::ddmin::{self, Oracle};
use super::parts::{LOSE, Selection, Whole};
use super::search::{Found, Halt, Search};
use super::trial::{Bench, Verdict};
use super::{Left, Tell, losses};

/// A scenario, and what is left of it.
pub(super) struct Stage<'s> {
    pub(super) whole: Whole,
    pub(super) kept: Selection,
    /// All lists there ever were.
    lists: Vec<Left>,
    /// When the run of what is left ended [ns].
    pub(super) end_ns: u64,
    /// How many single entries were left out at last, in vain.
    pub(super) proved: usize,
    smaller: &'s mut dyn FnMut(&Table),
}

impl<'s> Stage<'s> {
    pub(super) fn new(whole: Whole, end_ns: u64, smaller: &'s mut dyn FnMut(&Table)) -> Self {
        let mut stage = Stage {
            kept: whole.all(),
            whole,
            lists: Vec::new(),
            end_ns,
            proved: 0,
            smaller,
        };
        stage.note();
        stage
    }

    /// The scenario as it is left.
    pub(super) fn table(&self) -> Option<Table> {
        self.whole.keep(&self.kept)
    }

    /// Goes on with another scenario with which it happens.
    pub(super) fn begin(&mut self, bench: &Bench<'_>, table: Table, end_ns: u64, idle: &[u32]) {
        // Places of entries within others are other ones now.
        let read = bench.read(&table);
        let removable = read.map_or_else(|_| Vec::new(), |scenario| scenario.removable());
        self.whole = Whole::new(table, removable);
        self.kept = self.whole.all();
        self.note();
        self.end_ns = end_ns;
        self.drop_idle(idle);
        self.tell_smaller();
    }

    /// Remembers how much there is of each list that is seen for the first time.
    fn note(&mut self) {
        for part in &self.whole.parts {
            if self.lists.iter().all(|known| known.key != part.key) {
                self.lists.push(Left {
                    what: part.what,
                    key: part.key.clone(),
                    of: part.count,
                    left: 0,
                });
            }
        }
    }

    /// How much is left of each list there ever was.
    pub(super) fn left(&self) -> Vec<Left> {
        let left = |list: &Left| Left {
            left: self
                .whole
                .place_of(&list.key)
                .map_or(0, |place| self.kept[place].len()),
            ..list.clone()
        };
        self.lists.iter().map(left).collect()
    }

    fn tell_smaller(&mut self) {
        if let Some(table) = self.table() {
            (self.smaller)(&table);
        }
    }

    /// Ends the run sooner, if it still happens then.
    pub(super) fn set_until(
        &mut self,
        search: &mut Search<'_>,
        until: SimDuration,
    ) -> Result<(), Halt> {
        let Some(mut table) = self.table() else {
            return Ok(());
        };
        let before = table.get("until").and_then(Value::as_str);
        let before = before.and_then(|text| farside_actors::units::parse_duration(text).ok());
        if before.is_some_and(|before| before <= until) {
            return Ok(());
        }
        table.insert("until".to_owned(), Value::String(until.to_string()));
        let found = search.first(1, &|_| vec![table.clone()])?;
        if let Some(Found {
            verdict: Verdict::Violates { end_ns, idle },
            ..
        }) = found
        {
            self.begin(&search.bench, table, end_ns, &idle);
        }
        Ok(())
    }

    /// Leaves out list by list what can be left out, until nothing more goes.
    pub(super) fn reduce(&mut self, search: &mut Search<'_>) -> Result<(), Halt> {
        loop {
            let before = self.kept.clone();
            for part in 0..self.whole.parts.len() {
                let count = self.kept[part].len();
                if count > 0 {
                    let what = self.whole.parts[part].what;
                    (search.tell)(Tell::Now(format!("which of {count} {what} it takes")));
                }
                self.reduce_part(search, part)?;
            }
            if self.kept == before {
                return Ok(());
            }
        }
    }

    fn reduce_part(&mut self, search: &mut Search<'_>, part: usize) -> Result<(), Halt> {
        let mut levels = match self.whole.parts[part].key == LOSE {
            true => losses::groups(&self.whole.messages(part)),
            false => Vec::new(),
        };
        levels.push(self.kept[part].iter().map(|at| vec![*at]).collect());
        for mut units in levels {
            let kept = &self.kept[part];
            for unit in &mut units {
                unit.retain(|at| kept.binary_search(at).is_ok());
            }
            let mut oracle = OnePart {
                stage: self,
                search,
                part,
                found: None,
            };
            ddmin::reduce(units, &mut oracle)?;
        }
        Ok(())
    }

    /// Leaves out every single entry, whatever it is of: true if all of that was in vain. What goes is left out.
    pub(super) fn prove(&mut self, search: &mut Search<'_>) -> Result<bool, Halt> {
        let entries = |(part, kept): (usize, &Vec<u32>)| (0..kept.len()).map(move |at| (part, at));
        let all: Vec<(usize, usize)> = self.kept.iter().enumerate().flat_map(entries).collect();
        (search.tell)(Tell::Now(format!(
            "whether all of {} entries are needed",
            all.len()
        )));
        let (whole, now) = (&self.whole, &self.kept);
        let without = |number: usize| {
            let (part, at) = all[number];
            let mut kept = now.clone();
            kept[part].remove(at);
            candidates(whole, kept)
        };
        let made = |number: usize| tables(whole, &without(number));
        match search.first(all.len(), &made)? {
            None => {
                self.proved = all.len();
                Ok(true)
            }
            Some(found) => {
                let kept = without(found.number).swap_remove(found.alternative);
                self.take(search, kept, &found.verdict);
                Ok(false)
            }
        }
    }

    /// Goes on with what was found.
    fn take(&mut self, search: &Search<'_>, kept: Selection, verdict: &Verdict) {
        self.kept = kept;
        if let Verdict::Violates { end_ns, idle } = verdict {
            self.end_ns = *end_ns;
            self.drop_idle(idle);
        }
        self.tell_smaller();
        (search.tell)(Tell::Smaller(self.left()));
    }

    /// Leaves out losses that met no message, or changed nothing: without them it is the same run.
    fn drop_idle(&mut self, idle: &[u32]) {
        if let Some(lose) = self.whole.place_of(LOSE) {
            let mut at = 0..;
            self.kept[lose]
                .retain(|_| at.next().is_some_and(|at| idle.binary_search(&at).is_err()));
        }
    }
}

/// What stands for a candidate: all of it, or without entries that name who is gone.
fn candidates(whole: &Whole, kept: Selection) -> Vec<Selection> {
    let less = whole.without_strangers(&kept);
    std::iter::once(kept).chain(less).collect()
}

/// The scenarios of candidates; none of one that cannot be.
fn tables(whole: &Whole, candidates: &[Selection]) -> Vec<Table> {
    candidates
        .iter()
        .filter_map(|kept| whole.keep(kept))
        .collect()
}

/// Knows whether it happens with some of one list.
struct OnePart<'o, 's, 'a> {
    stage: &'o mut Stage<'s>,
    search: &'o mut Search<'a>,
    part: usize,
    found: Option<Found>,
}

impl Oracle for OnePart<'_, '_, '_> {
    type Halt = Halt;

    fn first(
        &mut self,
        count: usize,
        candidate: &(dyn Fn(usize) -> Vec<u32> + Sync),
    ) -> Result<Option<usize>, Halt> {
        let (stage, part) = (&*self.stage, self.part);
        let (whole, now) = (&stage.whole, &stage.kept);
        let made = |number: usize| {
            let mut kept = now.clone();
            kept[part] = candidate(number);
            tables(whole, &candidates(whole, kept))
        };
        self.found = self.search.first(count, &made)?;
        Ok(self.found.as_ref().map(|found| found.number))
    }

    fn accept(&mut self, found: Vec<u32>) -> Result<Vec<u32>, Halt> {
        let mut all = self.stage.kept.clone();
        all[self.part] = found;
        let mut candidates = candidates(&self.stage.whole, all);
        if let Some(Found {
            alternative,
            verdict,
            ..
        }) = self.found.take()
        {
            let kept = candidates.swap_remove(alternative.min(candidates.len() - 1));
            self.stage.take(self.search, kept, &verdict);
        }
        Ok(self.stage.kept[self.part].clone())
    }
}
