//! Names that somebody may have meant.

/// Nobody misspells longer names, and comparing takes as long as both names together.
const LONGEST: usize = 100;

/// The name that is nearest to one that is not known, if it may have been meant; of equally near
/// ones the first in the alphabet.
pub(crate) fn nearest<'a>(found: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    if found.len() > LONGEST {
        return None;
    }
    let lower = found.to_lowercase();
    let near = names.filter(|name| name.len() <= LONGEST).map(|name| {
        let of = name.to_lowercase();
        // The begin of a name is near it, however long the rest is.
        let begins = lower.chars().count() > 2 && of.starts_with(&lower);
        let distance = strsim::osa_distance(&lower, &of);
        (if begins { distance.min(1) } else { distance }, name)
    });
    let (distance, best) = near.min()?;
    (distance <= 1 + found.chars().count() / 3).then_some(best)
}

/// The question that an error ends with, or nothing if no name comes near what was found.
pub(crate) fn did_you_mean<'a>(found: &str, names: impl Iterator<Item = &'a str>) -> String {
    nearest(found, names).map_or_else(String::new, |name| format!("; did you mean {name:?}?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_one_that_may_have_been_meant() {
        let known = ["TakeImage", "TakeSpectrum", "Going"];
        let nearest = |name| nearest(name, known.into_iter());
        assert_eq!(nearest("TakeImge"), Some("TakeImage"));
        assert_eq!(nearest("takeimage"), Some("TakeImage"));
        assert_eq!(nearest("TakeS"), Some("TakeSpectrum"));
        assert_eq!(nearest("Idle"), None);
        assert_eq!(nearest(&"x".repeat(1_000_000)), None);
        assert_eq!(
            did_you_mean("Gong", known.into_iter()),
            "; did you mean \"Going\"?"
        );
    }
}
