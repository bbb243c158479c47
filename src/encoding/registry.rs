//! What the tracer knows between its passes, and the choices that follow from it.

use std::collections::BTreeMap;

use super::error::SchemaError;
use super::format::{Body, Container, Fields, Format, Variant, merge};

/// How many samples a place may refuse.
pub(super) const MAX_TRIES: u32 = 64;
/// A depth that no value has: the type cannot be built from what is known.
pub(super) const INFINITE: u32 = u32::MAX;

/// Why a pass ended early.
#[derive(Debug)]
pub(super) enum Halt {
    /// Something was learned that only a new pass can use.
    Again,
    /// The type refused a value; whoever gave it out tries another.
    Refused(String),
    /// A field was given twice: under its name and an alias.
    Duplicate(&'static str),
    /// The type has no schema; the reason is kept in the registry.
    Fatal,
}

/// Two containers are one if their values have the same Rust type, name and kind.
type Identity = (&'static str, &'static str, u8);

/// A field of a container.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    pub(super) container: usize,
    pub(super) variant: Option<usize>,
    pub(super) field: usize,
}

/// Everything learned about a root type.
#[derive(Debug, Default)]
pub(super) struct Registry {
    pub(super) containers: Vec<Container>,
    identities: BTreeMap<Identity, usize>,
    /// How many samples each place refused, and why the last.
    refusals: BTreeMap<u64, u32>,
    /// Counts what was learned, to notice when nothing is.
    pub(super) progress: u64,
    pub(super) fatal: Option<SchemaError>,
    /// How many options, collections and variants may still be filled, where values are wanted in
    /// which everything is there.
    pub(super) fills: Option<u32>,
    /// The fields that are being read, outermost first.
    pub(super) trail: Vec<Slot>,
    /// For each container at the start of the pass: the least depth of a value.
    depths: Vec<u32>,
    /// For each container at the start of the pass: whether nothing below it is unknown.
    complete: Vec<bool>,
}

impl Registry {
    /// Takes stock before a pass; says whether everything is known about `root`.
    pub(super) fn begin_pass(&mut self, root: &Format) -> bool {
        self.trail.clear();
        self.measure_depths();
        self.measure_completeness();
        *root != Format::Unknown && self.is_complete(root)
    }

    fn measure_depths(&mut self) {
        self.depths = vec![INFINITE; self.containers.len()];
        // Depths only fall, and each round settles at least one container.
        loop {
            let next: Vec<u32> = self
                .containers
                .iter()
                .map(|c| self.container_depth(c))
                .collect();
            if next == self.depths {
                return;
            }
            self.depths = next;
        }
    }

    fn measure_completeness(&mut self) {
        self.complete = vec![true; self.containers.len()];
        loop {
            let next: Vec<bool> = self
                .containers
                .iter()
                .map(|container| match &container.body {
                    Body::Fields(fields) => self.are_complete(container, fields),
                    Body::Enum(variants) => variants.iter().all(|variant| {
                        variant
                            .fields
                            .as_ref()
                            .is_some_and(|f| self.are_complete(container, f))
                    }),
                })
                .collect();
            if next == self.complete {
                return;
            }
            self.complete = next;
        }
    }

    fn are_complete(&self, container: &Container, fields: &Fields) -> bool {
        let known = |(at, format)| container.aliases.contains(&at) || self.is_complete(format);
        fields.formats().iter().enumerate().all(known)
    }

    /// Is everything below this format known?
    pub(super) fn is_complete(&self, format: &Format) -> bool {
        match format {
            Format::Unknown => false,
            Format::Option(inner) | Format::Seq(inner) => self.is_complete(inner),
            Format::Map(key, value) => self.is_complete(key) && self.is_complete(value),
            Format::Tuple(items) => items.iter().all(|item| self.is_complete(item)),
            Format::Container(id) => self.complete.get(*id).copied().unwrap_or(false),
            _ => true,
        }
    }

    fn container_depth(&self, container: &Container) -> u32 {
        let of = |fields: &Fields| self.fields_depth(container, fields);
        match &container.body {
            Body::Fields(fields) => of(fields),
            Body::Enum(_) => container
                .all_fields()
                .into_iter()
                .map(of)
                .min()
                .unwrap_or(INFINITE),
        }
    }

    fn fields_depth(&self, container: &Container, fields: &Fields) -> u32 {
        let formats = fields.formats().iter().enumerate();
        let kept = formats.filter(|(at, _)| !container.aliases.contains(at));
        let deepest = kept
            .map(|(_, format)| self.depth(format))
            .max()
            .unwrap_or(0);
        deepest.saturating_add(1)
    }

    /// The least depth of a value: options are none and collections are empty.
    pub(super) fn depth(&self, format: &Format) -> u32 {
        match format {
            Format::Unknown => INFINITE,
            Format::Tuple(items) => items.iter().map(|item| self.depth(item)).max().unwrap_or(0),
            Format::Container(id) => self.depths.get(*id).copied().unwrap_or(INFINITE),
            _ => 1,
        }
    }

    /// Can a value of this format be read without meeting, by value, a container that is being
    /// read already and cannot be built yet?
    pub(super) fn is_enterable(&self, format: &Format) -> bool {
        self.enterable(format, &mut Vec::new())
    }

    fn enterable(&self, format: &Format, seen: &mut Vec<usize>) -> bool {
        match format {
            Format::Tuple(items) => items.iter().all(|item| self.enterable(item, seen)),
            Format::Container(id) if self.is_open(*id) => self.depth(format) < INFINITE,
            Format::Container(id) if !seen.contains(id) => {
                seen.push(*id);
                match &self.containers[*id].body {
                    Body::Fields(fields) => fields
                        .formats()
                        .iter()
                        .all(|field| self.enterable(field, seen)),
                    Body::Enum(_) => true,
                }
            }
            _ => true,
        }
    }

    /// Takes note that one more is filled.
    pub(super) fn fill(&mut self) {
        self.fills = self.fills.map(|left| left.saturating_sub(1));
    }

    /// May an option or collection of this be filled? A type inside itself is entered once.
    pub(super) fn may_fill(&self, format: &Format) -> bool {
        match format {
            Format::Unknown => false,
            Format::Option(inner) | Format::Seq(inner) => self.may_fill(inner),
            Format::Map(key, value) => self.may_fill(key) && self.may_fill(value),
            Format::Tuple(items) => items.iter().all(|item| self.may_fill(item)),
            Format::Container(id) => self.may_enter(*id),
            _ => true,
        }
    }

    fn may_enter(&self, id: usize) -> bool {
        if self.fills == Some(0) {
            return false;
        }
        let open = self.trail.iter().filter(|slot| slot.container == id);
        open.count() < 2
    }

    /// Is the container being read further out?
    pub(super) fn is_open(&self, id: usize) -> bool {
        self.trail.iter().any(|slot| slot.container == id)
    }

    /// Should a container be read with the shortest choices only?
    pub(super) fn is_settled(&self, id: usize) -> bool {
        self.is_open(id) || self.complete.get(id).copied().unwrap_or(false)
    }

    /// Finds or adds a container.
    pub(super) fn container(
        &mut self,
        type_name: &'static str,
        name: &'static str,
        body: Body,
    ) -> Result<usize, Halt> {
        let kind = match &body {
            Body::Fields(Fields::Unit) => 0,
            Body::Fields(Fields::Newtype(_)) => 1,
            Body::Fields(Fields::Tuple(_)) => 2,
            Body::Fields(Fields::Struct(..)) => 3,
            Body::Enum(_) => 4,
        };
        if let Some(&id) = self.identities.get(&(type_name, name, kind)) {
            let same = match (&self.containers[id].body, &body) {
                (Body::Fields(a), Body::Fields(b)) => a.alike(b),
                (Body::Enum(a), Body::Enum(b)) => {
                    a.iter().map(|v| v.name).eq(b.iter().map(|v| v.name))
                }
                _ => false,
            };
            if same {
                return Ok(id);
            }
            let reason = "two types of this name have different fields";
            return Err(self.unsupported(type_name, reason));
        }
        let id = self.containers.len();
        let (aliases, first) = (Vec::new(), Vec::new());
        self.containers.push(Container {
            name,
            body,
            aliases,
            first,
        });
        self.identities.insert((type_name, name, kind), id);
        self.progress += 1;
        Ok(id)
    }

    /// Chooses the variant to read: one that is not fully known, the least visited first, or else
    /// the one with the shortest values.
    pub(super) fn choose(&mut self, id: usize, cheap: bool, tries: u32) -> Result<usize, Halt> {
        let container = &self.containers[id];
        let Body::Enum(variants) = &container.body else {
            return Err(Halt::Again);
        };
        let open = |variant: &Variant| match &variant.fields {
            None => true,
            Some(fields) => {
                !self.are_complete(container, fields)
                    && fields
                        .formats()
                        .iter()
                        .all(|format| self.is_enterable(format))
            }
        };
        let all = variants.iter().enumerate();
        let unknown = all
            .clone()
            .filter(|(_, v)| !cheap && open(v))
            .min_by_key(|(_, v)| v.visits);
        let depth = |v: &Variant| {
            v.fields
                .as_ref()
                .map_or(INFINITE, |fields| self.fields_depth(container, fields))
        };
        let mut finite: Vec<(u32, usize)> = all
            .map(|(at, v)| (depth(v), at))
            .filter(|(depth, _)| *depth < INFINITE)
            .collect();
        finite.sort_unstable();
        let chosen = match (unknown, finite.is_empty()) {
            (Some((at, _)), _) => at,
            (None, false) if self.fills.is_some() && !self.may_enter(id) => finite[0].1,
            (None, false) => finite[tries as usize % finite.len()].1,
            (None, true) => return Err(Halt::Again),
        };
        if let Body::Enum(variants) = &mut self.containers[id].body {
            variants[chosen].visits += 1;
        }
        Ok(chosen)
    }

    /// Notes how a variant is read.
    pub(super) fn set_variant(&mut self, id: usize, at: usize, new: Fields) -> Result<(), Halt> {
        let Body::Enum(variants) = &mut self.containers[id].body else {
            return Err(Halt::Again);
        };
        match &variants[at].fields {
            None => {
                variants[at].fields = Some(new);
                self.progress += 1;
                Ok(())
            }
            Some(old) if old.alike(&new) => Ok(()),
            Some(old) => {
                let (expected, actual) = (old.to_string(), new.to_string());
                let place = format!(
                    "{}.{}",
                    self.place(),
                    variants_name(&self.containers[id], at)
                );
                Err(self.fail(SchemaError::Conflict {
                    place,
                    expected,
                    actual,
                }))
            }
        }
    }

    /// What is known of a field.
    pub(super) fn format(&self, slot: Slot) -> Format {
        let fields = self.containers[slot.container].fields(slot.variant);
        fields
            .and_then(|fields| fields.formats().get(slot.field))
            .cloned()
            .unwrap_or_default()
    }

    /// Adds what was learned of a field.
    pub(super) fn learn(&mut self, slot: Slot, new: Format) -> Result<(), Halt> {
        let fields = match (&mut self.containers[slot.container].body, slot.variant) {
            (Body::Fields(fields), _) => Some(fields),
            (Body::Enum(variants), Some(at)) => variants[at].fields.as_mut(),
            (Body::Enum(_), None) => None,
        };
        let Some(old) = fields.and_then(|fields| fields.formats_mut().get_mut(slot.field)) else {
            return Ok(());
        };
        match merge(old, new) {
            Ok(any) => {
                self.progress += u64::from(any);
                Ok(())
            }
            Err((old, new)) => Err(self.conflict(&old, &new)),
        }
    }

    /// Ends a field that was read.
    pub(super) fn close(&mut self, slot: Slot, format: Format) -> Result<(), Halt> {
        let learned = self.learn(slot, format);
        self.trail.pop();
        learned
    }

    /// Ends a field at which a pass ends: what was learned of it is noted all the same.
    pub(super) fn close_halted(
        &mut self,
        slot: Slot,
        format: Format,
        site: u64,
        halt: Halt,
    ) -> Halt {
        let halt = self.halted(site, halt);
        self.close(slot, format).err().unwrap_or(halt)
    }

    /// What becomes of an end of a pass at the place that gave out the sample.
    pub(super) fn halted(&mut self, site: u64, halt: Halt) -> Halt {
        match halt {
            Halt::Refused(reason) => self.refuse(site, reason),
            other => other,
        }
    }

    /// How many samples were refused at this place.
    pub(super) fn tries(&self, site: u64) -> u32 {
        self.refusals.get(&site).copied().unwrap_or(0)
    }

    /// Notes that a sample was refused, so that the next pass gives another.
    pub(super) fn refuse(&mut self, site: u64, reason: String) -> Halt {
        let tries = self.refusals.entry(site).or_default();
        *tries += 1;
        self.progress += 1;
        if *tries < MAX_TRIES {
            return Halt::Again;
        }
        let place = self.place();
        self.fail(SchemaError::Refused {
            place,
            tries: MAX_TRIES,
            reason,
        })
    }

    /// Notes that a field came twice: one of its names is an alias.
    pub(super) fn alias(&mut self, id: usize, last: usize, primary: &'static str) -> Halt {
        let container = &mut self.containers[id];
        let names = match &container.body {
            Body::Fields(Fields::Struct(names, _)) => *names,
            _ => &[],
        };
        self.progress += 1;
        match names.iter().position(|name| *name == primary) {
            // The alias came before: read the field itself first, and the alias will be the one
            // that is refused.
            Some(own) if own == last && !container.first.contains(&own) => {
                container.first.push(own);
                Halt::Again
            }
            Some(own) if own != last && !container.aliases.contains(&last) => {
                container.aliases.push(last);
                Halt::Again
            }
            _ => self.unsupported(primary, "the field is read twice"),
        }
    }

    /// Where the tracer is, as in `Plan.steps`.
    pub(super) fn place(&self) -> String {
        let Some(slot) = self.trail.last() else {
            return "the root".to_owned();
        };
        let container = &self.containers[slot.container];
        let mut place = container.name.to_owned();
        if let Some(at) = slot.variant {
            place = format!("{place}.{}", variants_name(container, at));
        }
        match container.fields(slot.variant) {
            Some(Fields::Struct(names, _)) => format!("{place}.{}", names[slot.field]),
            Some(Fields::Tuple(_)) => format!("{place}.{}", slot.field),
            _ => place,
        }
    }

    pub(super) fn fail(&mut self, error: SchemaError) -> Halt {
        // The first error is the cause: later ones may be its wrapping.
        self.fatal.get_or_insert(error);
        Halt::Fatal
    }

    pub(super) fn unsupported(&mut self, type_name: &str, reason: &str) -> Halt {
        let (type_name, reason) = (type_name.to_owned(), reason.to_owned());
        let place = self.place();
        self.fail(SchemaError::Unsupported {
            type_name,
            place,
            reason,
        })
    }

    pub(super) fn conflict(&mut self, old: &Format, new: &Format) -> Halt {
        let (expected, actual) = (old.to_string(), new.to_string());
        let place = self.place();
        self.fail(SchemaError::Conflict {
            place,
            expected,
            actual,
        })
    }
}

fn variants_name(container: &Container, at: usize) -> &'static str {
    match &container.body {
        Body::Enum(variants) => variants[at].name,
        Body::Fields(_) => container.name,
    }
}
