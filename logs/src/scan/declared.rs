//! The schemas and channels that a file has declared so far.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use mcap::records::op;

use crate::channel::{ChannelInfo, Role, SchemaInfo};
use crate::parse::{ChannelRecord, SchemaRecord};

/// Whether a declaration stands in the summary, which repeats what was declared before.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Summary {
    Yes,
    No,
}

/// Whether nobody wants a channel's messages.
pub(super) type PassedOver = Box<dyn Fn(&ChannelInfo) -> bool + Send>;

/// What a file has declared so far.
#[derive(Default)]
pub(super) struct Declared {
    pub(super) schemas: BTreeMap<u16, Arc<SchemaInfo>>,
    pub(super) channels: Vec<Option<Slot>>,
    /// Every channel there was, by serial number.
    pub(super) all: Vec<Arc<ChannelInfo>>,
    pub(super) passed_over: Option<PassedOver>,
}

/// A channel that is declared.
pub(super) struct Slot {
    pub(super) channel: Arc<ChannelInfo>,
    /// Its messages are wanted by nobody.
    pub(super) is_passed_over: bool,
    /// Its messages are wanted by what they say.
    pub(super) is_looked_at: bool,
}

impl Declared {
    #[inline]
    pub(super) fn slot(&self, id: u16) -> Option<&Slot> {
        self.channels.get(usize::from(id)).and_then(Option::as_ref)
    }

    pub(super) fn channel(&self, id: u16) -> Option<&Arc<ChannelInfo>> {
        self.slot(id).map(|slot| &slot.channel)
    }

    pub(super) fn declare(&mut self, opcode: u8, content: &[u8], summary: Summary) -> Option<()> {
        if opcode == op::SCHEMA {
            let schema = SchemaRecord::parse(content)?;
            let known = self.schemas.get(&schema.id);
            let repeats = known.is_some_and(|known| known.says_the_same(&schema));
            if !repeats && (known.is_none() || summary == Summary::No) {
                self.add_schema(&schema);
            }
            return Some(());
        }
        let channel = ChannelRecord::parse(content)?;
        let known = self.channel(channel.id);
        let repeats = known.is_some_and(|known| known.says_the_same(&channel));
        if !repeats && (known.is_none() || summary == Summary::No) {
            self.add_channel(channel);
        }
        Some(())
    }

    fn add_schema(&mut self, schema: &SchemaRecord<'_>) {
        let info = Arc::new(SchemaInfo {
            name: schema.name.to_owned(),
            encoding: schema.encoding.to_owned(),
            data: schema.data.to_owned(),
            types: OnceLock::new(),
            layout: OnceLock::new(),
        });
        self.schemas.insert(schema.id, info.clone());
        // Channels that came in front of their schema.
        for Slot { channel, .. } in self.channels.iter_mut().flatten() {
            if channel.schema_id == schema.id && channel.schema.is_none() {
                let bound = ChannelInfo {
                    schema: Some(info.clone()),
                    topic: channel.topic.clone(),
                    encoding: channel.encoding.clone(),
                    metadata: channel.metadata.clone(),
                    ..**channel
                };
                *channel = Arc::new(bound);
                self.all[channel.serial as usize] = channel.clone();
            }
        }
    }

    fn add_channel(&mut self, channel: ChannelRecord<'_>) {
        let at = usize::from(channel.id);
        if self.channels.len() <= at {
            self.channels.resize_with(at + 1, || None);
        }
        let info = Arc::new(ChannelInfo {
            serial: self.all.len() as u32,
            topic: channel.topic.to_owned(),
            encoding: channel.encoding.to_owned(),
            schema: self.schemas.get(&channel.schema_id).cloned(),
            role: Role::of(&channel.metadata),
            metadata: channel.metadata,
            schema_id: channel.schema_id,
        });
        self.all.push(info.clone());
        let is_passed_over = self.passed_over.as_ref().is_some_and(|which| which(&info));
        let is_record = info.role == Role::Record;
        self.channels[at] = Some(Slot {
            is_looked_at: is_record && !info.topic.starts_with("/in_flight/"),
            channel: info,
            is_passed_over,
        });
    }
}
