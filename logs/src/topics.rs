//! Topic names, what each is for, and globs over them.

use farside::Pattern;
use farside::record::RecordClass;

use crate::LogError;

/// The topic of the checkpoints.
pub(crate) const CHECKPOINT: &str = "farside/checkpoint";

/// What a channel is for: the value of `role` in its metadata.
pub(crate) fn role(class: RecordClass) -> &'static str {
    match class {
        RecordClass::Sample => "state",
        class if class.is_fate() => "message",
        _ => "event",
    }
}

/// The topic of a record. What happens to actors and links is on one topic for all of them, by what
/// it is: a topic for each actor would be thousands, and the record says whom it happened to.
pub(crate) fn topic_of(class: RecordClass, sender: &str, receiver: &str, kind: &str) -> String {
    let kind = snake_case(kind);
    match class {
        RecordClass::Delivered => format!("/{sender}/{kind}"),
        RecordClass::Lost | RecordClass::InFlight | RecordClass::HandOver => {
            format!("/{}/{sender}/{kind}", class.name())
        }
        RecordClass::Timer => format!("/timer/{receiver}/{kind}"),
        RecordClass::Sample => format!("/state/{sender}/{kind}"),
        // One schema on a topic, so that viewers can show it.
        _ if kind.is_empty() => format!("/event/{}", class.name()),
        _ => format!("/event/{}/{kind}", class.name()),
    }
}

/// The topic that records of a topic go to where there can be no more topics: one of all actors for each
/// kind. The record itself says whose it is.
pub(crate) fn of_all_actors(topic: &str) -> String {
    let kind = topic.rsplit('/').next().unwrap_or_default();
    let classes = ["/timer", "/lost", "/in_flight", "/hand_over", "/state"];
    let is_of = |class: &&&str| {
        let rest = topic.strip_prefix(**class);
        rest.is_some_and(|rest| rest.starts_with('/'))
    };
    let class = classes.iter().find(is_of).copied().unwrap_or_default();
    format!("{class}/{OTHERS}/{kind}")
}

/// Stands for an actor in topics of all actors that have none of their own.
const OTHERS: &str = "others";

/// The same in logs before format 1.3, by which their `exclude` is to be read.
pub(crate) fn topic_before_1_3(
    class: RecordClass,
    sender: &str,
    receiver: &str,
    kind: &str,
) -> String {
    let topic = topic_of(class, sender, receiver, kind);
    match topic.starts_with("/event/") && class != RecordClass::Stop {
        true => format!("/event/{}/{receiver}", class.name()),
        false => topic,
    }
}

/// The kind's name in topics: `MaxPlus` becomes `max_plus`, `GpsFIX2` becomes `gps_fix2`.
pub(crate) fn snake_case(name: &str) -> String {
    let letters: Vec<char> = name.chars().collect();
    let mut out = String::with_capacity(name.len() + 4);
    for (at, letter) in letters.iter().enumerate() {
        if letter.is_uppercase() {
            let after_lower =
                at > 0 && (letters[at - 1].is_lowercase() || letters[at - 1].is_numeric());
            let before_lower = at > 0
                && letters[at - 1].is_uppercase()
                && letters.get(at + 1).is_some_and(|next| next.is_lowercase());
            if after_lower || before_lower {
                out.push('_');
            }
            out.extend(letter.to_lowercase());
        } else if letter.is_alphanumeric() || *letter == '_' {
            out.push(*letter);
        } else {
            out.push('_');
        }
    }
    out
}

/// A set of topic globs.
pub(crate) struct Topics {
    globs: Vec<Pattern>,
    /// If there are any: all topics that none of these matches are in the set, too.
    but: Vec<Pattern>,
}

impl Topics {
    pub(crate) fn new(globs: &[String]) -> Result<Self, LogError> {
        let read = |glob: &String| {
            Pattern::over_topics(glob).map_err(|error| LogError::Glob {
                glob: glob.to_owned(),
                reason: error.to_string(),
            })
        };
        let globs = globs.iter().map(read).collect::<Result<_, _>>()?;
        let but = Vec::new();
        Ok(Topics { globs, but })
    }

    /// The set with all topics besides, that none of these globs matches; as it is, if there are none.
    pub(crate) fn and_all_but(self, globs: &[String]) -> Result<Self, LogError> {
        let but = Topics::new(globs)?.globs;
        Ok(Topics { but, ..self })
    }

    pub(crate) fn matches(&self, topic: &str) -> bool {
        let any = |globs: &[Pattern]| globs.iter().any(|glob| glob.matches(topic));
        any(&self.globs) || (!self.but.is_empty() && !any(&self.but))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actors_share_topics_by_class_and_kind() {
        for (own, shared) in [
            ("/node_01/grant", "/others/grant"),
            ("/rover_01/hardware/rover_state", "/others/rover_state"),
            ("/lost/node_01/grant", "/lost/others/grant"),
            ("/timer/a/b/due", "/timer/others/due"),
            ("/state/a/pose", "/state/others/pose"),
            ("/lostling/pose", "/others/pose"),
        ] {
            assert_eq!(of_all_actors(own), shared);
        }
    }

    #[test]
    fn kinds_become_snake_case() {
        for (kind, topic) in [
            ("MaxPlus", "max_plus"),
            ("Ask", "ask"),
            ("GPSFix", "gps_fix"),
            ("Scan2D", "scan2_d"),
            ("already_snake", "already_snake"),
        ] {
            assert_eq!(snake_case(kind), topic);
        }
    }

    /// What is no delivery is on topics that no actor's messages are on.
    #[test]
    fn topics_of_no_actor_begin_with_what_is_reserved() {
        for class in [
            RecordClass::Lost,
            RecordClass::InFlight,
            RecordClass::HandOver,
            RecordClass::Timer,
            RecordClass::Sample,
            RecordClass::Start,
            RecordClass::Crash,
            RecordClass::Restart,
            RecordClass::Change,
            RecordClass::Stop,
            RecordClass::Told,
        ] {
            let topic = topic_of(class, "a", "b", "Kind");
            let first = topic.split('/').nth(1).expect("topics begin with a slash");
            assert!(farside::record::RESERVED.contains(&first), "{topic}");
        }
    }

    #[test]
    fn one_star_stays_within_a_level() {
        let topics = Topics::new(&["/*/max_plus".to_owned(), "/lost/**".to_owned()]).unwrap();
        assert!(topics.matches("/rover_1/max_plus"));
        assert!(!topics.matches("/in_flight/rover_1/max_plus"));
        assert!(topics.matches("/lost/team/rover_1/odometry"));
    }
}
