//! What messages say, as text, for as many as a page has room for.

use super::columns;

/// As many letters as are kept of one message.
const LETTERS: usize = 2_000;

/// As many bytes as are kept of all: a tenth of it is left once they are compressed.
pub(super) const BYTES: usize = 24 << 20;

/// As many bytes as they take on the page: texts that do not compress are fewer.
const PACKED: usize = 4 << 20;

/// The texts of the first rows, in their order.
#[derive(Clone, Debug, Default)]
pub(super) struct Details {
    most_bytes: usize,
    texts: Vec<u8>,
    ends: Vec<u32>,
    left_out: u64,
}

impl Details {
    pub(super) fn of_at_most(most_bytes: usize) -> Details {
        Details {
            most_bytes,
            ..Details::default()
        }
    }

    /// Adds the text of the next row, unless there is no room for more.
    pub(super) fn push(&mut self, text: impl FnOnce() -> String) {
        if self.left_out > 0 || self.texts.len() >= self.most_bytes {
            self.left_out += 1;
            return;
        }
        let text = text();
        match text.char_indices().nth(LETTERS) {
            Some((end, _)) => {
                self.texts.extend_from_slice(&text.as_bytes()[..end]);
                self.texts.extend_from_slice("…".as_bytes());
            }
            None => self.texts.extend_from_slice(text.as_bytes()),
        }
        self.ends.push(self.texts.len() as u32);
    }

    pub(super) fn rows(&self) -> usize {
        self.ends.len()
    }

    pub(super) fn left_out(&self) -> u64 {
        self.left_out
    }

    /// The texts as a block of the page, as many of the first as there is room for.
    pub(super) fn packed(&mut self) -> String {
        loop {
            let block = columns::block(&self.bytes());
            if block.len() <= PACKED || self.ends.is_empty() {
                return block;
            }
            let kept = self.ends.len() / 2;
            self.left_out += (self.ends.len() - kept) as u64;
            self.ends.truncate(kept);
            let end = self.ends.last().copied().unwrap_or(0);
            self.texts.truncate(end as usize);
        }
    }

    /// The ends of the texts, four bytes each, the least significant first, and then the texts.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let ends = self.ends.iter().flat_map(|end| end.to_le_bytes());
        ends.chain(self.texts.iter().copied()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_kept_in_order_until_there_is_no_room() {
        let mut details = Details::of_at_most(5);
        for text in ["ab", "", "cdé", "f", ""] {
            details.push(|| text.to_owned());
        }
        assert_eq!((details.rows(), details.left_out()), (3, 2));
        assert_eq!(&details.bytes()[12..], "abcdé".as_bytes());
        assert_eq!(&details.bytes()[8..12], [6, 0, 0, 0]);
        let block = details.packed();
        assert_eq!((details.rows(), block.contains('<')), (3, false));
        let mut long = Details::of_at_most(1 << 20);
        long.push(|| "é".repeat(3_000));
        assert_eq!(long.bytes().len(), 4 + 2 * LETTERS + "…".len());
    }

    #[test]
    fn texts_that_do_not_compress_take_no_more_room_than_others() {
        let mut details = Details::of_at_most(BYTES);
        let mut state = 1_u64;
        for _ in 0..6_000 {
            details.push(|| {
                let letter = |_| {
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1);
                    char::from(b' ' + (state >> 58) as u8)
                };
                (0..LETTERS).map(letter).collect()
            });
        }
        let block = details.packed();
        assert!(
            block.len() <= PACKED && block.len() > PACKED / 4,
            "{}",
            block.len()
        );
        assert_eq!(details.rows() as u64 + details.left_out(), 6_000);
    }
}
