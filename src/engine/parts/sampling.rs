//! State samples: what an actor shows of itself, and which Rust type a sample's name stands for.
//!
//! A log knows samples by the serde names of their types. Two types of one name would be written
//! under one schema, so that the second is a fault, whether anyone watches or not: what observes
//! changes nothing. Each engine notices what its own hosts do; what several engines do in one
//! window is compared, in key order, before it is committed.

use std::any::TypeId;
use std::sync::Arc;

use super::{Effect, Parts, Sink};
use crate::engine::{Class, Happened, Head};
use crate::fault::{Fault, FaultCause};
use crate::ids::{EntityId, KindIndex};
use crate::key::EventKey;
use crate::payload::Message;
use crate::record::RecordClass;
use crate::topology::Kind;

/// A type of samples that was met.
pub(crate) struct SampleType {
    type_id: TypeId,
    type_name: &'static str,
    /// How it is written, or why it cannot be.
    kind: Result<Arc<Kind>, String>,
}

/// The first sample of its type in one engine.
#[derive(Clone)]
pub(crate) struct FirstSample {
    pub(crate) key: EventKey,
    actor: EntityId,
    /// The message being handled, and who sent it.
    message: Option<String>,
    type_id: TypeId,
    type_name: &'static str,
    name: String,
}

impl FirstSample {
    /// The fault of a sample whose name stands for `first` already.
    fn fault(&self, first: &str, actor: &str) -> Box<Fault> {
        Box::new(Fault {
            key: self.key,
            time: self.key.time,
            actor: actor.to_owned(),
            message: self.message.clone(),
            cause: FaultCause::SampleNames {
                name: self.name.clone(),
                first: first.to_owned(),
                second: self.type_name.to_owned(),
            },
        })
    }
}

/// Which type each sample's name stands for, over all engines of a run.
#[derive(Default)]
pub(crate) struct SampleNames(Vec<FirstSample>);

impl SampleNames {
    /// Takes the first samples of all engines in one window, in any order; returns the fault of the
    /// earliest whose name stands for another type.
    pub(crate) fn take(
        &mut self,
        mut found: Vec<FirstSample>,
        name_of: impl Fn(EntityId) -> String,
    ) -> Option<Box<Fault>> {
        // Of one event, in the order in which its handler made them.
        found.sort_by_key(|sample| sample.key);
        for sample in found {
            match self.0.iter().find(|known| known.name == sample.name) {
                Some(known) if known.type_id != sample.type_id => {
                    return Some(sample.fault(known.type_name, &name_of(sample.actor)));
                }
                Some(_) => {}
                None => self.0.push(sample),
            }
        }
        None
    }
}

impl Parts {
    /// The number of a type of samples, which is met here for the first time or was before.
    #[inline]
    pub(crate) fn sample_type<S: Message>(&mut self, actor: EntityId) -> usize {
        let type_id = TypeId::of::<S>();
        let known = |known: &SampleType| known.type_id == type_id;
        match self.sample_types.iter().position(known) {
            Some(at) => at,
            None => {
                let kind = self.topology.sample_kind::<S>();
                self.meet_sample_type(actor, type_id, std::any::type_name::<S>(), kind)
            }
        }
    }

    #[cold]
    fn meet_sample_type(
        &mut self,
        actor: EntityId,
        type_id: TypeId,
        type_name: &'static str,
        kind: Result<Arc<Kind>, String>,
    ) -> usize {
        if let Ok(kind) = &kind {
            let named =
                |known: &&SampleType| known.kind.as_ref().is_ok_and(|k| k.name() == kind.name());
            match self.sample_types.iter().find(named) {
                Some(known) => {
                    let cause = FaultCause::SampleNames {
                        name: kind.name().to_owned(),
                        first: known.type_name.to_owned(),
                        second: type_name.to_owned(),
                    };
                    self.raise(cause);
                }
                None => self.effects.push(Effect::FirstSample(Box::new(FirstSample {
                    key: self.key,
                    actor,
                    message: None,
                    type_id,
                    type_name,
                    name: kind.name().to_owned(),
                }))),
            }
        }
        self.sample_types.push(SampleType {
            type_id,
            type_name,
            kind,
        });
        self.sample_types.len() - 1
    }

    /// Records a sample of this type, to be committed with the event in hand.
    pub(crate) fn add_sample<S: Message>(&mut self, entity: EntityId, at: usize, sample: &S) {
        let start = self.effect_bytes.len();
        let kind = self.sample_types[at].kind.clone().and_then(|kind| {
            let encoded = kind.schema().encode(sample, &mut self.effect_bytes);
            encoded.map(|()| kind).map_err(|error| error.to_string())
        });
        match kind {
            Ok(kind) => {
                let body = start..self.effect_bytes.len();
                self.effects.push(Effect::Sample { entity, kind, body });
            }
            // A run must not depend on whether it is watched, so a sample that cannot be written
            // is no fault.
            Err(error) => {
                self.effect_bytes.truncate(start);
                tracing::warn!(actor = self.topology.name(entity), %error, "state sample dropped");
            }
        }
    }

    /// Commits what happened in the event in hand, whose head this is, besides the event.
    pub(crate) fn commit_effects(&mut self, event: &Head, sink: &mut impl Sink) {
        for effect in self.effects.drain(..) {
            match effect {
                Effect::Lost { head, body, side } => {
                    let (class, body) = (RecordClass::Lost, &self.effect_bytes[body]);
                    sink.commit(&Happened {
                        class,
                        key: self.key,
                        head: &head,
                        side: side.as_deref(),
                        sample: None,
                        body,
                        sends: 0,
                        hash: head.hash_if_wanted(&self.topology, class, self.key, body),
                    });
                }
                Effect::Sample { entity, kind, body } => {
                    let head = Head::of_entity(Class::Message, entity);
                    let head = head.caused(self.key, KindIndex::MAX, 0);
                    sink.commit(&Happened {
                        class: RecordClass::Sample,
                        key: self.key,
                        head: &head,
                        side: None,
                        sample: Some(&kind),
                        body: &self.effect_bytes[body],
                        sends: 0,
                        hash: 0,
                    });
                }
                Effect::FirstSample(mut sample) => {
                    sample.message = event.message(&self.topology);
                    sink.first_sample(*sample);
                }
            }
        }
        self.effect_bytes.clear();
    }
}
