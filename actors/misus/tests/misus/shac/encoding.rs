//! What is sent, written and kept can be encoded, and comes back as it was.

use std::fmt::Debug;

use farside::encoding::Schema;
use farside_misus::shac::{
    CentreDurable, CentreWrite, GoalAck, GoalAssign, GoalCancel, GoalDigest, GoalOutcome,
    GoalRelease, GoalStatus, Message, OwnerDurable, OwnerWrite, Reason, Settings,
};
use serde::{Serialize, de::DeserializeOwned};

use super::team::{Team, goal, pair};

fn comes_back<T: Serialize + DeserializeOwned + PartialEq + Debug + 'static>(value: &T) {
    let schema = Schema::of::<T>().unwrap();
    let mut bytes = Vec::new();
    schema.encode(value, &mut bytes).unwrap();
    assert_eq!(&schema.decode::<T>(&bytes).unwrap(), value);
}

#[test]
fn all_that_is_sent_and_kept_comes_back() {
    let mut team = Team::new(Settings::new("lease", 3, &[3]).unwrap());
    let [first, second] = pair(20);
    for goal in [goal(7), goal(8), first, second] {
        team.centre(|centre, now| centre.add(now, goal));
    }
    team.centre(|centre, now| centre.assign(now, goal(7).key, &[0]));
    team.centre(|centre, now| centre.assign(now, goal(8).key, &[0]));
    team.centre(|centre, now| centre.assign(now, first.key, &[1, 2]));
    team.owner(0, |owner, now| owner.accept(now, goal(7).key))
        .unwrap();
    team.owner(0, |owner, now| owner.begin(now, goal(7).key))
        .unwrap();
    team.owner(0, |owner, now| owner.done(now, goal(7).key))
        .unwrap();
    team.owner(0, |owner, now| owner.accept(now, goal(8).key))
        .unwrap();
    team.owner(1, |owner, now| owner.accept(now, first.key))
        .unwrap();
    team.centre(|centre, now| centre.withdraw(now, second.key));
    team.owner(0, |owner, now| {
        owner.release(now, goal(8).key, Reason::Worth)
    })
    .unwrap();
    let mut kinds = [0; 7];
    for (_, _, message) in &team.arrived {
        let kind = match message {
            Message::Assign(message) => (0, comes_back::<GoalAssign>(message)),
            Message::Ack(message) => (1, comes_back::<GoalAck>(message)),
            Message::Status(message) => (2, comes_back::<GoalStatus>(message)),
            Message::Release(message) => (3, comes_back::<GoalRelease>(message)),
            Message::Cancel(message) => (4, comes_back::<GoalCancel>(message)),
            Message::Outcome(message) => (5, comes_back::<GoalOutcome>(message)),
            Message::Digest(message) => (6, comes_back::<GoalDigest>(message)),
        };
        kinds[kind.0] += 1;
    }
    assert!(kinds.iter().all(|&count| count > 0), "{kinds:?}");
    comes_back::<CentreDurable>(team.centre.durable());
    for owner in &team.owners {
        comes_back::<OwnerDurable>(owner.durable());
        for holding in owner.durable().held.values() {
            comes_back(&OwnerWrite::Held(*holding));
        }
    }
    for record in team.centre.durable().table.values() {
        comes_back(&CentreWrite::Goal(record.clone()));
    }
}
