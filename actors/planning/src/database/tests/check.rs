//! What holds of a database after every edit, seen from its tokens and instances alone.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use crate::database::rules::{Guard, Instance, Step};
use crate::database::*;
use crate::model::{Target, TimelineKind};
use crate::parameters::Operand;
use crate::profile::Profile;

/// Panics where something does not hold.
pub(super) fn check(database: &mut Database) {
    check_after(database, false);
}

/// The same where the past may have been forgotten: what tokens that are gone said of others is
/// nobody's then.
pub(super) fn check_after(database: &mut Database, forgot: bool) {
    timelines(database);
    relations(database);
    constraints(database, forgot);
    variables(database);
    levels(database);
}

fn timelines(database: &Database) {
    let mut listed = BTreeSet::new();
    for timeline in 0..database.lanes.len() {
        let kind = database.model.timelines[timeline].kind;
        let mut before = None;
        let mut count = 0;
        for token in database.on(timeline) {
            let at = database.at(token);
            assert_eq!((at.status, at.timeline), (Status::Active, Some(timeline)));
            assert_eq!(at.before, before, "{token:?} follows the one before it");
            if let Some(before) = before
                && kind != TimelineKind::Free
            {
                let (ends, starts) = (database.finish(before), database.start(token));
                assert!(
                    ends.min <= starts.min && ends.max <= starts.max,
                    "{ends:?} {starts:?}"
                );
            }
            assert!(listed.insert(token));
            before = Some(token);
            count += 1;
        }
        let lane = database.lanes[timeline];
        assert_eq!((lane.last, lane.tokens), (before, count));
    }
    for (token, at) in database.tokens() {
        assert_eq!(
            listed.contains(&token),
            at.status == Status::Active,
            "{token:?}"
        );
        let lasts = at.timeline.map_or(0, |timeline| {
            let kind = database.model.timelines[timeline].kind;
            i64::from(kind != TimelineKind::Free)
        });
        let (starts, ends) = (database.start(token), database.finish(token));
        assert!(
            ends.min >= starts.min + lasts && ends.max >= starts.max + lasts,
            "{token:?}: {starts:?} {ends:?}"
        );
        if at.status != Status::Active {
            assert!(at.instances.is_empty() && at.before.is_none() && at.after.is_none());
        }
        for &other in &at.merged {
            assert_eq!(database.at(other).status, Status::Merged(token));
        }
        if let Status::Merged(into) = at.status {
            assert!(database.at(into).merged.contains(&token));
        }
        let asked = at.supported.len() + at.merged.len();
        assert_eq!(at.supports as usize, asked, "{token:?}");
    }
}

/// All steps that an instance asks for by now.
fn asked(database: &Database, at: &Instance) -> Vec<Step> {
    let flat = &database.flats[at.rule];
    let mut all = Vec::new();
    let mut next = flat.top.clone();
    while let Some(step) = next.pop() {
        all.push(step);
        if let Step::Choice(choice) = step
            && let Some(chosen) = at.chosen(choice as usize)
        {
            next.extend(&flat.choices[choice as usize][chosen as usize]);
        }
    }
    all
}

fn relations(database: &Database) {
    let mut open: Vec<Open> = database.open().to_vec();
    for (id, at) in database.instances.iter() {
        assert_eq!(at.guard, database.guard(id), "{at:?}");
        let asked = if at.guard == Guard::Holds {
            asked(database, at)
        } else {
            Vec::new()
        };
        for step in asked {
            let place = open
                .iter()
                .position(|at| (at.instance, at.step) == (id, step));
            if let Some(place) = place {
                open.remove(place);
                continue;
            }
            match step {
                Step::Choice(choice) => assert!(at.chosen(choice as usize).is_some()),
                Step::Relation(relation) => fulfilled(database, id, relation),
            }
        }
    }
    assert!(open.is_empty(), "nobody asks for {open:?}");
}

/// A relation that is not open is fulfilled by a token that is what it asks for.
fn fulfilled(database: &Database, id: InstanceId, relation: u32) {
    let at = database.instance_at(id);
    let said = database.relation(id, relation);
    let label = match &said.target {
        Target::New(_, label) | Target::Label(label) => *label,
    };
    let token = at
        .label(label)
        .expect("a relation that is not open has a token");
    let anchor = at.label(said.anchor).expect("it has an anchor");
    let (Some(is), Some(_)) = (database.token(token), database.token(anchor)) else {
        return; // They are of the past.
    };
    assert_eq!(is.status, Status::Active);
    if let Target::New(pattern, _) = &said.target {
        assert!(is.supported.contains(&(id, relation)));
        assert_eq!(is.predicate, pattern.predicate);
        for (place, argument) in pattern.arguments.iter().enumerate() {
            let wish = match *argument {
                crate::model::Argument::Any => continue,
                crate::model::Argument::Value(value) => Operand::Value(value),
                crate::model::Argument::Variable(variable) => at
                    .variable(variable)
                    .expect("a variable stands for something"),
            };
            assert_eq!(database.values(wish), database.values(is.parameters[place]));
        }
    }
    for distance in &said.distances {
        let from = database.time(anchor, distance.from);
        let to = database.time(token, distance.to);
        let span = database.span(id, distance.min, distance.max, distance.backward);
        let (a, b) = (database.bounds_of(from), database.bounds_of(to));
        // The earliest times are a schedule, and so are the latest.
        assert!(
            span.contains(b.min - a.min) && span.contains(b.max - a.max),
            "{said:?}"
        );
    }
}

/// All constraints are somebody's, and each that somebody has is there or went with a point.
fn constraints(database: &Database, forgot: bool) {
    let mut times = BTreeSet::new();
    let mut values = BTreeSet::new();
    for (_, at) in database.tokens() {
        times.extend(at.times.iter().chain(&at.orders).chain(&at.merged_times));
        times.extend(at.order);
        values.extend(at.values.iter().chain(&at.merged_values));
    }
    for (_, at) in database.instances.iter() {
        times.extend(
            at.times
                .iter()
                .filter_map(|posted| posted.constraint.as_ref()),
        );
        values.extend(at.values.iter().map(|(_, posted)| posted));
    }
    for mirror in &database.mirrors {
        times.extend(mirror.time);
        values.extend(mirror.value);
    }
    let past = |owner: Option<&Owner>| {
        let gone = |token| database.token(token).is_none();
        forgot
            && match *owner.expect("it has an owner") {
                Owner::Rule { master, .. } => gone(master),
                Owner::Token(token) => gone(token),
                owner => matches!(owner, Owner::Past | Owner::Decision(_)),
            }
    };
    for (constraint, ..) in database.network.all_constraints() {
        let owner = database.network.owner(constraint);
        assert!(
            times.contains(&constraint) || past(owner),
            "{owner:?} has nobody"
        );
    }
    for (constraint, owner) in database.store.all_constraints() {
        assert!(
            values.contains(&constraint) || past(Some(owner)),
            "{owner:?} has nobody"
        );
    }
    let points: BTreeSet<_> = database
        .tokens()
        .flat_map(|(_, at)| [at.start, at.finish])
        .filter_map(|time| match time {
            Time::Point(point) => Some(point),
            Time::At(_) => None,
        })
        .collect();
    assert_eq!(
        database.network.points(),
        points.len() + 1,
        "points are of tokens"
    );
    bounds(database);
}

/// Bounds of times are those of a network with the same constraints.
fn bounds(database: &Database) {
    let mut rebuilt = Network::new(database.horizon());
    let mut points = BTreeMap::from([(database.network.origin(), rebuilt.origin())]);
    for (point, _) in database.network.all_bounds() {
        let within = database.network.added_within(point);
        points
            .entry(point)
            .or_insert_with(|| rebuilt.add_point_within(within).expect("there is room"));
    }
    for (_, from, to, span) in database.network.all_constraints() {
        let posted = rebuilt.constrain(points[&from], points[&to], span, Owner::Given);
        posted.expect("what holds can be posted");
    }
    for (point, span) in database.network.all_bounds() {
        assert_eq!(span, rebuilt.bounds(points[&point]), "{point:?}");
    }
}

/// A variable is there as long as somebody has it, and tells those who asked.
fn variables(database: &Database) {
    let mut holders: BTreeMap<usize, u32> = BTreeMap::new();
    let mut hold = |operand: Operand| {
        if let Operand::Variable(variable) = operand {
            assert!(database.store.has(variable), "{variable:?} is there");
            *holders.entry(variable.index()).or_default() += 1;
        }
    };
    for (_, at) in database.tokens() {
        at.parameters.iter().copied().for_each(&mut hold);
    }
    for (_, at) in database.instances.iter() {
        at.variables.iter().copied().flatten().for_each(&mut hold);
    }
    for mirror in &database.mirrors {
        hold(Operand::Variable(mirror.variable));
    }
    assert_eq!(database.store.variables(), holders.len());
    for (place, &count) in database.holders.iter().enumerate() {
        assert_eq!(count, holders.get(&place).copied().unwrap_or(0));
    }
    let mut watchers: BTreeMap<usize, BTreeSet<InstanceId>> = BTreeMap::new();
    for (id, at) in database.instances.iter() {
        for variable in &at.watched {
            // One in whose place a value stands watches no more.
            if !database.store.has(*variable) {
                continue;
            }
            watchers.entry(variable.index()).or_default().insert(id);
        }
    }
    for (place, all) in database.watchers.iter().enumerate() {
        let is: BTreeSet<InstanceId> = all.iter().copied().collect();
        assert_eq!(is, watchers.get(&place).cloned().unwrap_or_default());
    }
}

/// Profiles are those that the effects of all instances make.
fn levels(database: &mut Database) {
    for resource in 0..database.model.resources.len() {
        let is = database.levels(resource).clone();
        let at = &database.model.resources[resource];
        let initials = [is.flexible.initial(), is.earliest.initial()];
        let mut rebuilt = initials.map(|initial| Profile::<Owner>::new(initial, at.limits));
        for (id, at) in database.instances.iter() {
            for effected in at.effects.iter().filter(|at| at.resource == resource) {
                let uses = database.uses_of(id, effected.effect, resource);
                for (profile, one) in rebuilt.iter_mut().zip(uses) {
                    profile.add(one, Owner::Given).expect("it fits");
                }
            }
        }
        for (is, rebuilt) in [&is.flexible, &is.earliest].into_iter().zip(&rebuilt) {
            assert_eq!(is.len(), rebuilt.len());
            for tick in 0..=database.horizon().max {
                assert_eq!(is.level(tick), rebuilt.level(tick), "{resource} at {tick}");
            }
        }
    }
}

/// One number for all that there is.
pub(super) fn digest(database: &mut Database) -> u64 {
    let mut hasher = DefaultHasher::new();
    let mut text = String::new();
    database.refresh();
    let mut say = |part: &dyn std::fmt::Debug| {
        text.clear();
        write!(text, "{part:?}").expect("a text takes it");
        text.hash(&mut hasher);
    };
    for (token, at) in database.tokens.iter() {
        say(&(token, at));
    }
    for (instance, at) in database.instances.iter() {
        say(&(instance, at));
    }
    for watchers in database.watchers.iter().filter(|all| !all.is_empty()) {
        say(watchers);
    }
    say(&(&database.lanes, &database.open, &database.mirrors));
    for point in database.network.all_bounds() {
        say(&point);
    }
    for constraint in database.network.all_constraints() {
        say(&(constraint, database.network.owner(constraint.0)));
    }
    for variable in database.store.all_domains() {
        say(&variable);
    }
    for (constraint, owner) in database.store.all_constraints() {
        say(&(constraint, owner, database.store.kind(constraint)));
        for operand in database.store.operands(constraint) {
            say(&operand);
        }
    }
    for levels in &database.levels_by_resource {
        for profile in [&levels.flexible, &levels.earliest] {
            say(&profile.initial());
            for one in profile.uses() {
                say(&one);
            }
        }
    }
    hasher.finish()
}
