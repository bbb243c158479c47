//! Stories made for the purpose.

use farside_actors::system::{Account, Doing, Phase};

use super::story::{Lost, Story, Touching, seconds};
use super::text::{Told, losses, rows};

fn phase(from_ns: u64, until_ns: u64, doing: Doing, text: &str) -> Phase {
    Phase {
        from_ns,
        until_ns,
        doing,
        text: text.to_owned(),
        waits_for: Vec::new(),
    }
}

fn lost(at_ns: u64, id: &str, is_for_it: bool) -> Lost {
    let id: farside::ruling::MessageId = id.parse().unwrap();
    Lost {
        at_ns,
        is_for_it,
        peer: if is_for_it {
            id.sender.clone()
        } else {
            id.receiver.clone()
        },
        link: "n-r".to_owned(),
        reason: "loss".to_owned(),
        id,
    }
}

#[test]
fn short_waits_stand_with_what_is_around_them() {
    use Doing::{Active, Done, Waiting};
    let phases = [
        phase(0, 10, Active, "drives from 1 to 2"),
        phase(10, 12, Waiting, "stands at 2"),
        phase(12, 20, Active, "drives from 2 to 5"),
        phase(20, 60, Waiting, "stands at 5, waits for b"),
        phase(60, 70, Active, "drives from 5 to 6"),
        phase(70, 70, Done, "is at its goal 6"),
    ];
    let told: Vec<(u64, u64, String)> = rows(&phases, 5)
        .into_iter()
        .map(|row| (row.from_ns, row.until_ns, row.text))
        .collect();
    let row = |from, until, text: &str| (from, until, text.to_owned());
    assert_eq!(
        told,
        [
            row(
                0,
                20,
                "drives from 1 to 2 … drives from 2 to 5; 1 short wait, 0.000 s in all"
            ),
            row(20, 60, "stands at 5, waits for b"),
            row(60, 70, "drives from 5 to 6"),
            row(70, 70, "is at its goal 6"),
        ]
    );
    assert_eq!(rows(&phases, 0).len(), phases.len());
}

#[test]
fn losses_are_counted_by_what_was_lost() {
    let all = [
        lost(1_000_000_000, "n,r,Grant,4", true),
        lost(2_000_000_000, "n,r,Grant,5", true),
        lost(2_500_000_000, "r,n,Beacon,5", false),
    ];
    assert_eq!(
        losses(&all, true).unwrap(),
        "lost on the way to it: 2 Grant from n (n-r: loss, 1.000 s to 2.000 s)"
    );
    assert_eq!(
        losses(&all, false).unwrap(),
        "lost of what it sent: 1 Beacon to n (n-r: loss, at 2.500 s)"
    );
    assert_eq!(losses(&all[..2], false), None);
}

#[test]
fn a_story_says_all_that_it_knows() {
    let second = 1_000_000_000;
    let mut account = Account::default();
    account.push(phase(0, second, Doing::Active, "drives"));
    account.push(phase(second, 3 * second, Doing::Waiting, "stands"));
    let story = Story {
        actor: "r".to_owned(),
        until_ns: 3 * second,
        is_told_by_system: true,
        account,
        losses: vec![lost(2 * second, "n,r,Grant,4", true)],
        silence_ns: Some([second, 3 * second]),
        degrades: vec![Touching {
            entry: 0,
            from_ns: second,
            until_ns: None,
            text: "loss = 1.0".to_owned(),
        }],
        crashes: Vec::new(),
        end: "enough".to_owned(),
        remarks: vec!["a remark".to_owned()],
    };
    assert_eq!(seconds(1_499_999), "0.001 s");
    let expected = "\
r up to 3.000 s: 1.000 s active, 2.000 s waiting, not done
the run ended: enough

     0.000 s      1.000 s  active   drives
     1.000 s      3.000 s  waiting  stands
                                    lost on the way to it: 1 Grant from n (n-r: loss, at 2.000 s)

longest silence on its links: 2.000 s, 1.000 s to 3.000 s
[[degrade]] 1: loss = 1.0, 1.000 s on
a remark
";
    let told = Told {
        story: &story,
        least_ns: 0,
    };
    assert_eq!(told.to_string(), expected);
}
