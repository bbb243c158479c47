//! What viewers draw, written between the records: asked of a [`Scene`], in the order of time.

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::RunInfo;
use farside::record::{Record, RecordClass};
use farside::scene::{Drawing, Scene};
use mcap::records::MessageHeader;

use super::chunk::Chunk;
use super::foxglove::Layers;
use super::{Channels, Live};
use crate::LogError;

/// What a channel that viewers draw is for.
const ROLE: &str = "viewer";

/// A scene, and where what it draws goes.
pub(super) struct Stage {
    scene: Box<dyn Scene>,
    run: Arc<RunInfo>,
    /// Kept for its memory: most records change nothing that is seen.
    drawings: Vec<Drawing>,
    layers: Layers,
    topics: BTreeMap<String, Topic>,
}

/// A topic that was drawn on.
#[derive(Clone, Copy)]
struct Topic {
    /// None if it is not to be written.
    channel: Option<u16>,
    messages: u32,
}

impl Stage {
    pub(super) fn new(scene: Box<dyn Scene>, run: Arc<RunInfo>) -> Stage {
        Stage {
            scene,
            run,
            drawings: Vec::new(),
            layers: Layers::default(),
            topics: BTreeMap::new(),
        }
    }

    fn write(
        &mut self,
        time_ns: u64,
        channels: &mut Channels,
        chunk: &mut Chunk,
        excluded: impl Fn(&str) -> bool,
    ) -> Result<(), LogError> {
        for drawn in self.layers.draw(&self.drawings, time_ns) {
            if !self.topics.contains_key(&drawn.topic) {
                let schema = || drawn.schema.schema();
                let channel = if excluded(&drawn.topic) {
                    None
                } else {
                    Some(channels.get(chunk, &drawn.topic, ROLE, "", schema)?)
                };
                let topic = Topic {
                    channel,
                    messages: 0,
                };
                self.topics.insert(drawn.topic.clone(), topic);
            }
            if let Some(topic) = self.topics.get_mut(&drawn.topic)
                && let Some(channel) = topic.channel
            {
                let header = MessageHeader {
                    channel_id: channel,
                    sequence: topic.messages,
                    log_time: time_ns,
                    publish_time: time_ns,
                };
                topic.messages += 1;
                chunk.message(header, |out| out.extend_from_slice(&drawn.body));
            }
        }
        self.drawings.clear();
        Ok(())
    }
}

impl Live {
    /// Draws what there is at the start.
    pub(super) fn draw_begin(&mut self) -> Result<(), LogError> {
        let Some(stage) = &mut self.stage else {
            return Ok(());
        };
        stage.scene.begin(&stage.run, &mut stage.drawings);
        let excluded = |topic: &str| self.encoder.excludes(topic);
        stage.write(self.epoch_ns, &mut self.channels, &mut self.chunk, excluded)
    }

    /// Draws what `record`, just written, changes.
    pub(super) fn draw(&mut self, record: &Record<'_>) -> Result<(), LogError> {
        let Some(stage) = &mut self.stage else {
            return Ok(());
        };
        // What is under way at the end has not happened.
        if record.class == RecordClass::InFlight || !self.at_end.is_empty() {
            return Ok(());
        }
        stage.scene.record(record, &stage.run, &mut stage.drawings);
        if stage.drawings.is_empty() {
            return Ok(());
        }
        let time_ns = self.epoch_ns.saturating_add(self.last_ns);
        let excluded = |topic: &str| self.encoder.excludes(topic);
        stage.write(time_ns, &mut self.channels, &mut self.chunk, excluded)
    }
}
