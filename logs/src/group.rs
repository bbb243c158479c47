//! Topics that say the same of many actors, as one line: for lists that people read.

use std::collections::BTreeMap;

/// The most rows of a list that groups nothing.
pub(crate) const UNGROUPED: usize = 30;

/// The topic with `*` for each run of digits: what `/node_01/grant` and `/node_02/grant` share.
fn pattern(topic: &str) -> String {
    let mut out = String::with_capacity(topic.len());
    let mut in_digits = false;
    for letter in topic.chars() {
        let digit = letter.is_ascii_digit();
        match (digit, in_digits) {
            (true, false) => out.push('*'),
            (true, true) => {}
            (false, _) => out.push(letter),
        }
        in_digits = digit;
    }
    out
}

/// Items whose topics have one pattern, by pattern, in name order. A topic that is alone keeps its
/// name; `all` leaves each one alone.
pub(crate) fn groups<'a, T>(
    items: &'a [T],
    all: bool,
    topic: impl Fn(&T) -> &str,
) -> Vec<(String, Vec<&'a T>)> {
    if all {
        let alone = |item: &'a T| (topic(item).to_owned(), vec![item]);
        return items.iter().map(alone).collect();
    }
    let mut by_pattern: BTreeMap<String, Vec<&T>> = BTreeMap::new();
    for item in items {
        by_pattern
            .entry(pattern(topic(item)))
            .or_default()
            .push(item);
    }
    let named = |(pattern, items): (String, Vec<&'a T>)| {
        let same = items.iter().all(|item| topic(item) == topic(items[0]));
        let name = if same {
            topic(items[0]).to_owned()
        } else {
            pattern
        };
        (name, items)
    };
    by_pattern.into_iter().map(named).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_of_numbered_actors_share_a_row_and_one_alone_keeps_its_name() {
        let topics = ["/a_01/x", "/a_02/x", "/lost/a_1/x", "/scan2/y"];
        let rows = |all| -> Vec<(String, usize)> {
            let groups = groups(&topics, all, |topic| topic);
            groups
                .into_iter()
                .map(|(name, of)| (name, of.len()))
                .collect()
        };
        let named = [("/a_*/x", 2), ("/lost/a_1/x", 1), ("/scan2/y", 1)];
        assert_eq!(rows(false), named.map(|(name, n)| (name.to_owned(), n)));
        assert_eq!(rows(true).len(), 4);
    }
}
