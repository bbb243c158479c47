//! What events need is fetched before their turn comes. Where very much waits it lies in no cache, and
//! to wait for it takes longer than the rest of an event.

use super::{Engine, Parts};
use crate::queue::{BATCH, Entry};

impl Engine {
    /// Fetches what the next events will need. It lies anywhere in memory, and one thing says where the
    /// next is: an event names its receiver, whose cell holds the actor. So each is fetched a batch of
    /// events before what it leads to. In batches, since a processor that has to look up a page waits
    /// for that, but looks up several at once.
    #[inline(never)]
    pub(super) fn fetch_ahead(&mut self) {
        let Parts {
            queue,
            store,
            topology,
            ..
        } = &mut self.parts;
        self.until_fetch = BATCH;
        if !store.is_large() {
            return;
        }
        queue.look_ahead();
        // Not every event is an actor's.
        let cell = |entry: &Entry| {
            let place = topology.place(store.receiver(entry.slot));
            self.actors.get(place.local as usize)
        };
        for cell in queue.batch(0).iter().filter_map(cell) {
            cell.fetch_actor();
        }
        for cell in queue.batch(1).iter().filter_map(cell) {
            cell.fetch();
        }
        for entry in queue.batch(2) {
            store.fetch(entry.slot);
        }
    }

    /// Numbers and queues what was sent; see [`Outbox`](super::outbox::Outbox).
    pub(super) fn queue_sent(&mut self) {
        let all = self.parts.outbox.len();
        self.queue_first(all);
    }

    /// Fetches what numbering and queuing what was sent last will need, and numbers and queues that for
    /// which this was done before.
    #[inline(never)]
    pub(super) fn queue_fetched(&mut self) {
        let Parts { queue, outbox, .. } = &mut self.parts;
        for message in outbox.unfetched() {
            let sender = &self.actors[message.sender as usize];
            sender.state.fetch_flow(message.declared, message.kind);
            queue.fetch(&message.entry);
        }
        let fetched = self.parts.outbox.fetched();
        self.queue_first(fetched);
        self.parts.outbox.all_fetched();
    }

    fn queue_first(&mut self, messages: usize) {
        let Parts {
            topology,
            queue,
            store,
            outbox,
            ..
        } = &mut self.parts;
        for message in outbox.take(messages) {
            let receiver = topology.declared[message.declared as usize];
            let sender = &mut self.actors[message.sender as usize];
            let ordinal = sender.state.next_in_flow(message.declared, message.kind);
            store.complete(message.entry.slot, receiver, ordinal);
            queue.push(message.entry);
        }
        outbox.taken();
    }
}
