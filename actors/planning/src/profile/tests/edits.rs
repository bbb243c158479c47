//! After every edit: what is kept is what one finds from the uses alone.

use proptest::prelude::*;

use super::*;

#[derive(Clone, Debug)]
enum Edit {
    Add(Use),
    Update(usize, Use),
    /// Other times, or another amount, only.
    Retime(usize, Use),
    Remove(usize),
    Push,
    Pop,
    Commit,
}

fn any_use() -> impl Strategy<Value = Use> {
    let length = || prop_oneof![3 => Just(0i64), 2 => 0..12i64];
    let change = (-4..4i64, length()).prop_map(|(least, more)| Span::new(least, least + more / 4));
    (
        0..30i64,
        length(),
        0..12i64,
        length(),
        any::<bool>(),
        change,
    )
        .prop_map(|(start, more, duration, longer, is_for_good, change)| {
            let start = Span::new(start, start + more);
            let end = Span::new(start.min + duration, start.max + duration + longer);
            Use {
                start,
                end: (!is_for_good).then_some(end),
                change,
            }
        })
}

fn edit() -> impl Strategy<Value = Edit> {
    let pick = || 0..1_000usize;
    prop_oneof![
        6 => any_use().prop_map(Edit::Add),
        3 => (pick(), any_use()).prop_map(|(of, one)| Edit::Update(of, one)),
        3 => (pick(), any_use()).prop_map(|(of, one)| Edit::Retime(of, one)),
        4 => pick().prop_map(Edit::Remove),
        1 => Just(Edit::Push),
        1 => Just(Edit::Pop),
        1 => Just(Edit::Commit),
    ]
}

const LIMITS: Span = Span::new(-6, 7);
const INITIAL: i64 = 1;

/// How a use changes the level at a tick, at least and at most, by going through all its times.
fn changes(one: &Use, tick: Ticks) -> Span {
    let mut found: Option<Span> = None;
    let mut may = |change: Span| {
        let all = found.unwrap_or(change);
        found = Some(Span::new(all.min.min(change.min), all.max.max(change.max)));
    };
    for start in one.start.min..=one.start.max {
        let ends = one.end.unwrap_or(Span::exactly(Ticks::MAX));
        for end in ends.min.max(start)..=ends.max {
            if start <= tick && tick < end {
                may(one.change);
            } else {
                may(Span::exactly(0));
            }
            if end == Ticks::MAX {
                break;
            }
        }
    }
    found.unwrap_or(Span::exactly(0))
}

fn level(uses: &[Use], tick: Ticks) -> Span {
    uses.iter().fold(Span::exactly(INITIAL), |level, one| {
        let change = changes(one, tick);
        Span::new(level.min + change.min, level.max + change.max)
    })
}

/// From before all times to after them.
const TICKS: std::ops::Range<Ticks> = -1..70;

fn check(profile: &Profile<u32>) -> Result<(), TestCaseError> {
    let uses: Vec<Use> = profile.uses().map(|(_, one, _)| *one).collect();
    let levels: Vec<Span> = TICKS.map(|tick| level(&uses, tick)).collect();
    for (tick, level) in TICKS.zip(&levels) {
        prop_assert_eq!(profile.level(tick), *level, "at {} of {:?}", tick, uses);
    }
    for (from, many) in [(0, 30), (5, 1), (17, 9)] {
        let during = Span::new(from, from + many);
        let all = levels[(from - TICKS.start) as usize..]
            .iter()
            .take(many as usize + 1);
        let all = all.fold(Span::new(i64::MAX, i64::MIN), |all, level| {
            Span::new(all.min.min(level.min), all.max.max(level.max))
        });
        prop_assert_eq!(profile.levels(during), all);
        for change in [-4, 3] {
            let fits = |start: &Ticks| {
                let mut ticks = levels[(start - TICKS.start) as usize..]
                    .iter()
                    .take(many as usize);
                ticks.all(|level| match change {
                    ..0 => level.min + change >= LIMITS.min,
                    _ => level.max + change <= LIMITS.max,
                })
            };
            let is_in = |start: &Ticks| start + many < TICKS.end;
            let expected = (from..TICKS.end).filter(is_in).find(fits);
            let found = profile.first_fit(from, many, change);
            prop_assert_eq!(found.filter(is_in), expected);
        }
    }
    let mut rebuilt = Profile::new(INITIAL, LIMITS);
    for (_, one, owner) in profile.uses() {
        rebuilt.add(*one, *owner).unwrap();
    }
    prop_assert!(profile.envelope().eq(rebuilt.envelope()));
    let of = |at: &OverUse<u32>| {
        let contributors = at
            .contributors
            .iter()
            .map(|one| (one.owner, one.amount, one.is_certain));
        let mut contributors: Vec<_> = contributors.collect();
        contributors.sort_unstable();
        (
            (at.bound, at.during, at.amount, at.worst_tick, at.is_certain),
            contributors,
        )
    };
    let found: Vec<_> = profile.over_uses().map(|at| of(&at)).collect();
    let again: Vec<_> = rebuilt.over_uses().map(|at| of(&at)).collect();
    prop_assert_eq!(&found, &again);
    let mut expected = Vec::new();
    for bound in [Bound::Least, Bound::Most] {
        for over_use in by_scanning(bound, &levels) {
            let Some(((_, _, _, worst, _), contributors)) = found.get(expected.len()) else {
                return Err(TestCaseError::fail("an over-use was not found"));
            };
            let mut owners = Vec::new();
            for (_, one, owner) in profile.uses() {
                let change = changes(one, *worst);
                let amount = if bound == Bound::Least {
                    -change.min
                } else {
                    change.max
                };
                let is_in_force = !(change.contains(0) && change != one.change);
                if amount > 0 {
                    owners.push((
                        *owner,
                        amount,
                        is_in_force && !change.contains(0) || certain(one, *worst),
                    ));
                }
            }
            owners.sort_unstable();
            prop_assert_eq!(contributors, &owners);
            expected.push(over_use);
        }
    }
    let found: Vec<_> = found.into_iter().map(|(over_use, _)| over_use).collect();
    prop_assert_eq!(found, expected);
    Ok(())
}

/// Whether a use is in force at a tick whatever its times are.
fn certain(one: &Use, tick: Ticks) -> bool {
    let probe = Use {
        change: Span::exactly(1),
        ..*one
    };
    changes(&probe, tick) == Span::exactly(1)
}

type Found = (Bound, Span, i64, Ticks, bool);

fn by_scanning(bound: Bound, levels: &[Span]) -> Vec<Found> {
    let beyond = |level: i64| match bound {
        Bound::Least => LIMITS.min - level,
        Bound::Most => level - LIMITS.max,
    };
    let mut found: Vec<Found> = Vec::new();
    let mut is_open = false;
    for (tick, level) in TICKS.zip(levels) {
        let (worst, best) = match bound {
            Bound::Least => (beyond(level.min), beyond(level.max)),
            Bound::Most => (beyond(level.max), beyond(level.min)),
        };
        match found.last_mut() {
            Some(last) if is_open && worst > 0 => {
                last.1.max = tick;
                if worst > last.2 {
                    (last.2, last.3) = (worst, tick);
                }
                last.4 |= best > 0;
            }
            _ if worst > 0 => found.push((bound, Span::exactly(tick), worst, tick, best > 0)),
            _ => {}
        }
        is_open = worst > 0;
    }
    if is_open && let Some(last) = found.last_mut() {
        last.1.max = Ticks::MAX;
    }
    found
}

/// All that there is to know, by which states are compared.
type Whole = (
    Vec<(UseId, Use, u32)>,
    Vec<Step>,
    Vec<Interval>,
    Vec<Interval>,
    i128,
    usize,
    i64,
);

fn whole(profile: &Profile<u32>) -> Whole {
    (
        profile
            .uses()
            .map(|(id, one, owner)| (id, *one, *owner))
            .collect(),
        profile.steps.entries().copied().collect(),
        profile.in_force.entries().copied().collect(),
        profile.open.entries().copied().collect(),
        profile.magnitude,
        profile.owners.len(),
        profile.initial,
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    /// After every edit the levels, over-uses and contributors are those that all uses together
    /// say tick by tick, and those of a profile that is built anew; what is undone is as it was.
    #[test]
    fn edits_leave_what_uses_say(edits in prop::collection::vec(edit(), 0..24)) {
        let mut profile = Profile::new(INITIAL, LIMITS);
        let mut ids: Vec<UseId> = Vec::new();
        let mut kept: Vec<(Vec<UseId>, Whole)> = Vec::new();
        for (owner, edit) in (0..).zip(edits) {
            let place = |of: usize| (!ids.is_empty()).then(|| of % ids.len());
            match edit {
                Edit::Add(one) => ids.push(profile.add(one, owner).unwrap()),
                Edit::Update(of, one) => if let Some(place) = place(of) {
                    profile.update(ids[place], one).unwrap();
                },
                Edit::Retime(of, one) => if let Some(place) = place(of) {
                    let old = *profile.get(ids[place]).unwrap();
                    let keeps_times = of % 2 == 0;
                    let one = if keeps_times { Use { change: one.change, ..old } }
                        else { Use { change: old.change, ..one } };
                    profile.update(ids[place], one).unwrap();
                },
                Edit::Remove(of) => if let Some(place) = place(of) {
                    let id = ids.remove(place);
                    profile.remove(id);
                    prop_assert_eq!((profile.get(id), profile.owner(id)), (None, None));
                },
                Edit::Push => {
                    profile.push();
                    kept.push((ids.clone(), whole(&profile)));
                }
                Edit::Pop => {
                    profile.pop();
                    if let Some((old, state)) = kept.pop() {
                        ids = old;
                        prop_assert_eq!(whole(&profile), state);
                    }
                }
                Edit::Commit => {
                    profile.commit();
                    kept.pop();
                }
            }
            prop_assert_eq!(profile.depth(), kept.len());
            check(&profile)?;
        }
        while let Some((_, state)) = kept.pop() {
            profile.pop();
            prop_assert_eq!(whole(&profile), state);
        }
    }

    /// When the past is forgotten, what comes is as before; undone, the past is back.
    #[test]
    fn the_future_knows_what_was_forgotten(
        uses in prop::collection::vec(any_use(), 0..12),
        before in 0..60i64,
    ) {
        let mut profile = Profile::new(INITIAL, LIMITS);
        let ids: Vec<UseId> = uses.iter().map(|one| profile.add(*one, 0).unwrap()).collect();
        let state = whole(&profile);
        let levels = |profile: &Profile<u32>| -> Vec<Span> {
            (before..TICKS.end).map(|tick| profile.level(tick)).collect()
        };
        let expected = levels(&profile);
        profile.push();
        for (id, one) in ids.into_iter().zip(&uses) {
            let is_past = one.end.unwrap_or(one.start).max <= before;
            let is_known = one.end.is_some() || one.change.min == one.change.max;
            prop_assert_eq!(profile.forget(id, before), is_past && is_known);
        }
        prop_assert_eq!(levels(&profile), expected);
        profile.pop();
        prop_assert_eq!(whole(&profile), state);
    }
}
