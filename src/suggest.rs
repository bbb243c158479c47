//! Names that somebody may have meant.

/// The name closest to `found` in spelling, if any comes near.
///
/// ```
/// use farside::suggest::nearest;
/// let names = ["latency", "loss", "rate"];
/// assert_eq!(nearest("latncy", names.into_iter()).as_deref(), Some("latency"));
/// assert_eq!(nearest("x", names.into_iter()), None);
/// ```
pub fn nearest<'a>(found: &str, names: impl Iterator<Item = &'a str>) -> Option<String> {
    let name = closest(found, names)?;
    let limit = found.chars().count().max(name.chars().count()) / 2 + 1;
    (strsim::damerau_levenshtein(found, name) <= limit).then(|| name.to_owned())
}

/// The name closest to `found` in spelling, however far; the first of several.
pub fn closest<'a>(found: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    names.min_by_key(|name| strsim::damerau_levenshtein(found, name))
}

/// The question that an error ends with, or nothing.
///
/// ```
/// use farside::suggest::did_you_mean;
/// assert_eq!(did_you_mean(Some("loss")), "; did you mean \"loss\"?");
/// assert_eq!(did_you_mean(None), "");
/// ```
pub fn did_you_mean(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |name| format!("; did you mean {name:?}?"))
}
