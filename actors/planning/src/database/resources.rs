//! What tokens do to resources, at the times that they may have and at their earliest times.

use smallvec::SmallVec;

use super::{Conflict, Database, InstanceId, Owner, TokenId};
use crate::Ticks;
use crate::model::{Effect, EffectKind, End, Resource, ResourceId, ResourceKind, Value};
use crate::profile::{Profile, Use, UseId};
use crate::temporal::Span;

/// The levels of a resource over time.
#[derive(Clone)]
pub struct Levels {
    /// Whatever times tokens have, each within its bounds.
    pub flexible: Profile<Owner>,
    /// If each token starts and ends as early as it can. These times satisfy all constraints, so
    /// that they are a schedule.
    pub earliest: Profile<Owner>,
}

/// What an effect of a rule is, in the profiles of the resource that it is done to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effected {
    pub(super) effect: u32,
    pub(super) resource: ResourceId,
    flexible: UseId,
    earliest: UseId,
}

impl Levels {
    /// Without tokens: with what the model says.
    pub(super) fn of(resource: &Resource) -> Self {
        let mut levels = Levels {
            flexible: Profile::new(resource.initial, resource.limits),
            earliest: Profile::new(resource.initial, resource.limits),
        };
        for &(tick, change) in &resource.changes {
            let added = levels.change(tick, change);
            debug_assert!(added.is_ok(), "the model was checked");
        }
        levels
    }

    fn each(&mut self) -> [&mut Profile<Owner>; 2] {
        [&mut self.flexible, &mut self.earliest]
    }

    fn change(&mut self, tick: Ticks, change: Value) -> Result<(), Conflict> {
        let owner = Owner::Given;
        for profile in self.each() {
            let one = Use::production(Span::exactly(tick), Span::exactly(change));
            profile
                .add(one, owner)
                .map_err(|_| Conflict::Amount { owner })?;
        }
        Ok(())
    }
}

impl Database {
    /// The levels of a resource over time, as tokens have their times now.
    pub fn levels(&mut self, resource: ResourceId) -> &Levels {
        self.refresh();
        &self.levels_by_resource[resource]
    }

    /// The levels of a resource as [`levels`](Self::levels) gave them last.
    pub(crate) fn known_levels(&self, resource: ResourceId) -> &Levels {
        &self.levels_by_resource[resource]
    }

    /// From a tick on there is so much more of a resource, by nobody's token.
    ///
    /// # Errors
    ///
    /// If amounts add up to more than a profile takes.
    pub fn change_level(
        &mut self,
        resource: ResourceId,
        tick: Ticks,
        change: Value,
    ) -> Result<(), Conflict> {
        self.levels_by_resource[resource].change(tick, change)
    }

    /// Says that an instance's effect is done to another of the resources that will do.
    ///
    /// # Errors
    ///
    /// If amounts add up to more than a profile takes: nothing changes.
    ///
    /// # Panics
    ///
    /// If the instance has no such effect.
    pub fn assign(
        &mut self,
        instance: InstanceId,
        effect: u32,
        resource: ResourceId,
    ) -> Result<(), Conflict> {
        self.attempt(|database| {
            let effects = &database.instance_at(instance).effects;
            let place = effects.iter().position(|at| at.effect == effect);
            let place = place.expect("the instance has the effect");
            let old = effects[place];
            database.take_effect_back(old);
            let new = database.put_effect(instance, effect, resource)?;
            database.change_instance(instance).effects[place] = new;
            Ok(())
        })
    }

    /// The resources to which an instance's effects are done, by effect.
    pub fn assigned(&self, instance: InstanceId) -> SmallVec<[(u32, ResourceId); 2]> {
        let effects = self.instance_at(instance).effects.iter();
        effects.map(|at| (at.effect, at.resource)).collect()
    }

    /// The rule holds now: its effects are done to the first resources that will do.
    pub(super) fn apply_effects(&mut self, instance: InstanceId) -> Result<(), Conflict> {
        let rule = self.instance_at(instance).rule;
        if self.model.rules[rule].effects.is_empty() {
            return Ok(());
        }
        let model = self.model.clone();
        for (place, effect) in model.rules[rule].effects.iter().enumerate() {
            let Some(&resource) = effect.resources.first() else {
                continue;
            };
            self.watch_bounds(instance, [effect.amount; 2]);
            let effected = self.put_effect(instance, place as u32, resource)?;
            self.change_instance(instance).effects.push(effected);
        }
        Ok(())
    }

    fn put_effect(
        &mut self,
        instance: InstanceId,
        effect: u32,
        resource: ResourceId,
    ) -> Result<Effected, Conflict> {
        let at = self.instance_at(instance);
        let owner = at.owner(None);
        let [flexible, earliest] = self.uses_of(instance, effect, resource);
        let levels = &mut self.levels_by_resource[resource];
        let amount = |_| Conflict::Amount { owner };
        self.steps += 1;
        Ok(Effected {
            effect,
            resource,
            flexible: levels.flexible.add(flexible, owner).map_err(amount)?,
            earliest: levels.earliest.add(earliest, owner).map_err(amount)?,
        })
    }

    pub(super) fn take_effect_back(&mut self, effected: Effected) {
        let levels = &mut self.levels_by_resource[effected.resource];
        levels.flexible.remove(effected.flexible);
        levels.earliest.remove(effected.earliest);
    }

    /// The profiles are to follow a token's times.
    pub(super) fn dirty_if_used(&mut self, token: TokenId) {
        if !self.levels_by_resource.is_empty() {
            self.dirty.push(token);
        }
    }

    /// Whether what an effect does has been done at a tick, and how much it was is known.
    pub(super) fn is_over(&self, effected: Effected, tick: Ticks) -> bool {
        let levels = &self.levels_by_resource[effected.resource];
        let over = |profile: &Profile<Owner>, id| {
            let one = profile.get(id);
            one.is_some_and(|one| {
                let known = one.change.min == one.change.max || one.end.is_some();
                known && one.end.unwrap_or(one.start).max <= tick
            })
        };
        over(&levels.flexible, effected.flexible) && over(&levels.earliest, effected.earliest)
    }

    /// An effect of the past is a part of the level with which the resource begins.
    pub(super) fn forget_effect(&mut self, effected: Effected, before: Ticks) {
        let levels = &mut self.levels_by_resource[effected.resource];
        let ids = [effected.flexible, effected.earliest];
        for (profile, id) in levels.each().into_iter().zip(ids) {
            let gone = profile.forget(id, before);
            debug_assert!(gone, "what it does is over");
        }
    }

    /// What an effect is to a profile: at all times that it may have, and at the earliest.
    pub(super) fn uses_of(
        &self,
        instance: InstanceId,
        effect: u32,
        resource: ResourceId,
    ) -> [Use; 2] {
        let at = self.instance_at(instance);
        let Effect { kind, amount, .. } = self.model.rules[at.rule].effects[effect as usize];
        let amount = self.span(instance, amount, amount, false);
        let amount = Span::new(amount.min.max(0), amount.max);
        let times = [self.start(at.master), self.finish(at.master)];
        let kind_of = self.model.resources[resource].kind;
        let of = |[start, finish]: [Span; 2]| {
            let when = |end| if end == End::Start { start } else { finish };
            match (kind, kind_of) {
                (EffectKind::Uses, ResourceKind::RateLimited { window_ticks }) => {
                    Use::rate_limited(start, window_ticks, amount)
                }
                (EffectKind::Consumes(end), ResourceKind::RateLimited { window_ticks }) => {
                    Use::rate_limited(when(end), window_ticks, amount)
                }
                (EffectKind::Uses, _) => Use::renewable(start, finish, amount),
                (EffectKind::Consumes(end), _) => Use::consumption(when(end), amount),
                (EffectKind::Produces(end), _) => Use::production(when(end), amount),
            }
        };
        [of(times), of(times.map(|time| Span::exactly(time.min)))]
    }

    /// Profiles follow the times and amounts that changed.
    pub(super) fn refresh(&mut self) {
        if self.levels_by_resource.is_empty() {
            return;
        }
        let mut points = std::mem::take(&mut self.changed_points);
        points.clear();
        self.network.take_changed(&mut points);
        for &point in &points {
            if let Some(Some(token)) = self.token_of_point.get(point.index()) {
                self.dirty.push(*token);
            }
        }
        self.changed_points = points;
        let mut dirty = std::mem::take(&mut self.dirty);
        dirty.sort_unstable();
        dirty.dedup();
        for &token in &dirty {
            self.refresh_token(token);
        }
        dirty.clear();
        self.dirty = dirty;
    }

    fn refresh_token(&mut self, token: TokenId) {
        let Some(at) = self.tokens.get(token) else {
            return;
        };
        for instance in at.instances.clone() {
            for place in 0..self.instance_at(instance).effects.len() {
                let effected = self.instance_at(instance).effects[place];
                let uses = self.uses_of(instance, effected.effect, effected.resource);
                self.steps += 1;
                let levels = &mut self.levels_by_resource[effected.resource];
                let ids = [effected.flexible, effected.earliest];
                for ((profile, id), one) in levels.each().into_iter().zip(ids).zip(uses) {
                    let updated = profile.update(id, one);
                    debug_assert!(updated.is_ok(), "{updated:?}");
                }
            }
        }
    }

    pub(super) fn push_levels(&mut self) {
        self.refresh();
        for levels in &mut self.levels_by_resource {
            levels.each().into_iter().for_each(Profile::push);
        }
    }

    pub(super) fn pop_levels(&mut self) {
        for levels in &mut self.levels_by_resource {
            levels.each().into_iter().for_each(Profile::pop);
        }
        // They are as they were at the push, and so are all times.
        let mut points = std::mem::take(&mut self.changed_points);
        self.network.take_changed(&mut points);
        points.clear();
        self.changed_points = points;
        self.dirty.clear();
    }

    pub(super) fn commit_levels(&mut self) {
        for levels in &mut self.levels_by_resource {
            levels.each().into_iter().for_each(Profile::commit);
        }
    }
}
