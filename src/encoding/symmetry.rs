//! Holds a type's `Serialize` to its `Deserialize`: what is written is read, and what is left out
//! comes back. Types of messages need not be comparable, so that both are looked at through
//! what they write.

use std::collections::BTreeSet;
use std::sync::atomic::Ordering;

use super::error::{EncodeError, SchemaError};
use super::flat::{Field, FlatSchema, Shape, ValueType};
use super::sampled::Sampled;
use super::wire::take_field;
use crate::guard::{dropped, guarded};

/// A field, by its message and its place there.
type Place = (usize, usize);

/// What `Serialize` does with a value.
struct Written {
    bytes: Vec<u8>,
    /// The fields that it leaves out on purpose.
    left_out: BTreeSet<Place>,
}

/// Checks values that were read while the type was traced, and others in which everything is there.
pub(super) fn check(
    type_name: &str,
    flat: &FlatSchema,
    met: &[Box<dyn Sampled>],
    filled: &[Box<dyn Sampled>],
) -> Result<(), SchemaError> {
    let check = Check { flat };
    let refused = |reason: String| SchemaError::Asymmetric {
        type_name: type_name.to_owned(),
        reason,
    };
    for value in met.iter().chain(filled) {
        check.comes_back(&**value).map_err(refused)?;
    }
    check.all_is_written(filled).map_err(refused)?;
    for (id, message) in flat.messages.iter().enumerate() {
        if message.shape == Shape::Struct {
            check.defaults_come_back(id, filled).map_err(refused)?;
        }
    }
    Ok(())
}

struct Check<'a> {
    flat: &'a FlatSchema,
}

impl Check<'_> {
    /// Writes a value. None if the type itself refuses to, as it may with samples.
    fn write(&self, value: &dyn Sampled) -> Result<Option<Written>, String> {
        self.fields().for_each(|(_, field)| {
            field.left_out.store(false, Ordering::Relaxed);
        });
        let mut bytes = Vec::new();
        match guarded(|| value.encode_noting(self.flat, &mut bytes)) {
            Ok(Ok(())) => {}
            // A panic as well: samples are no values that a run has.
            Ok(Err(EncodeError::Custom(_))) | Err(_) => return Ok(None),
            Ok(Err(error)) => return Err(error.to_string()),
        }
        let left_out = self
            .fields()
            .filter(|(_, field)| field.left_out.load(Ordering::Relaxed));
        let left_out = left_out.map(|(place, _)| place).collect();
        Ok(Some(Written { bytes, left_out }))
    }

    fn fields(&self) -> impl Iterator<Item = (Place, &Field)> {
        let messages = self.flat.messages.iter().enumerate();
        messages.flat_map(|(id, message)| {
            let fields = message.fields.iter().enumerate();
            fields.map(move |(at, field)| ((id, at), field))
        })
    }

    /// What was read of a written value is written again as it was.
    fn comes_back(&self, value: &dyn Sampled) -> Result<(), String> {
        let Some(written) = self.write(value)? else {
            return Ok(());
        };
        let Ok(read) = guarded(|| value.decode_another(self.flat, &written.bytes)) else {
            return Ok(());
        };
        let read = read.map_err(|error| error.to_string())?;
        let again = self.write(&*read);
        let _ = dropped(read);
        let Some(again) = again? else {
            return Ok(());
        };
        // Not the bytes: a type may round what it reads.
        let before = written.left_out.symmetric_difference(&again.left_out);
        let (one, other) = (self.present(&written), self.present(&again));
        let mut differs = before.chain(one.symmetric_difference(&other));
        differs.next().map_or(Ok(()), |&(id, at)| {
            let place = &self.flat.messages[id].fields[at].place;
            Err(format!(
                "`{place}` is left out for a value other than the one that `Deserialize` takes where \
                 it is missing"
            ))
        })
    }

    /// Every field of a struct is written for some value in which everything is there.
    fn all_is_written(&self, filled: &[Box<dyn Sampled>]) -> Result<(), String> {
        let (mut present, mut met) = (BTreeSet::new(), BTreeSet::new());
        for value in filled {
            if let Some(written) = self.write(&**value)? {
                self.note(0, &written.bytes, &mut present, &mut met);
            }
        }
        let missing = self.fields().find(|((id, at), _)| {
            let is_struct = self.flat.messages[*id].shape == Shape::Struct;
            is_struct && (met.contains(id) && !present.contains(&(*id, *at)))
        });
        missing.map_or(Ok(()), |(_, field)| {
            let place = &field.place;
            Err(format!(
                "`{place}` is read by `Deserialize`, but `Serialize` leaves it out, so that it would \
                 not come back"
            ))
        })
    }

    /// What `Deserialize` takes where fields of this message are missing comes back as well.
    fn defaults_come_back(&self, id: usize, filled: &[Box<dyn Sampled>]) -> Result<(), String> {
        /// Defaults seldom hang on the fields beside them.
        const VALUES: usize = 2;
        for value in filled.iter().take(VALUES) {
            let Some(written) = self.write(&**value)? else {
                continue;
            };
            self.flat.messages[id]
                .withheld
                .store(true, Ordering::Relaxed);
            let read = guarded(|| value.decode_another(self.flat, &written.bytes));
            self.flat.messages[id]
                .withheld
                .store(false, Ordering::Relaxed);
            // A type that validates may have no use for its own defaults.
            if let Ok(Ok(read)) = read {
                let checked = self.comes_back(&*read);
                let _ = dropped(read);
                checked?;
            }
        }
        Ok(())
    }

    /// The fields that are there.
    fn present(&self, written: &Written) -> BTreeSet<Place> {
        let mut present = BTreeSet::new();
        self.note(0, &written.bytes, &mut present, &mut BTreeSet::new());
        present
    }

    /// Notes which fields are there, and which messages are met.
    fn note(
        &self,
        id: usize,
        bytes: &[u8],
        present: &mut BTreeSet<Place>,
        met: &mut BTreeSet<usize>,
    ) {
        met.insert(id);
        let mut pos = 0;
        while pos < bytes.len() {
            let Ok((number, payload)) = take_field(bytes, &mut pos) else {
                return;
            };
            let at = number as usize - 1;
            present.insert((id, at));
            if let Some(ValueType::Message(inner)) = self.flat.messages[id]
                .fields
                .get(at)
                .map(|field| field.kind)
            {
                self.note(inner, payload.bytes, present, met);
            }
        }
    }
}
