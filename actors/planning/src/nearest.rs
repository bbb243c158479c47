//! Names that somebody may have meant.

/// The question that an error ends with, or nothing if no name comes near what was found.
pub(crate) fn did_you_mean<'a>(found: &str, names: impl Iterator<Item = &'a str>) -> String {
    // Comparing takes as long as both names together: nobody misspells names that long.
    const LONGEST: usize = 100;
    if found.len() > LONGEST {
        return String::new();
    }
    let near = |name: &&str| {
        let limit = found.chars().count().max(name.chars().count()) / 2 + 1;
        (name.len() <= LONGEST)
            .then(|| strsim::damerau_levenshtein(found, name))
            .filter(|&distance| distance <= limit)
    };
    let nearest = names
        .filter_map(|name| near(&name).map(|distance| (distance, name)))
        .min_by_key(|&(distance, _)| distance);
    nearest.map_or_else(String::new, |(_, name)| format!("; did you mean {name:?}?"))
}
