//! What waits to be compared, in buckets: in memory while it is little, in a temporary file of the
//! system once it is much. The file has no name, and is gone with the comparison however that ends.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

use crate::LogError;
use crate::parse::Parser;

/// How many buckets there are: one at a time is in memory as a whole.
pub(super) const BUCKETS: usize = 128;

/// Something of a fixed size.
pub(super) trait Fixed: Copy {
    /// How many bytes it has in the file, which are about as many as in memory.
    const BYTES: usize;

    fn put(&self, out: &mut Vec<u8>);

    fn take(parser: &mut Parser<'_>) -> Option<Self>;
}

/// Values in buckets; each bucket keeps their order.
pub(super) struct Buckets<T> {
    held: Vec<Vec<T>>,
    count: usize,
    /// How many may be in memory before they are written to the file.
    most: usize,
    file: Option<File>,
    /// The parts of the file that belong to a bucket: where each starts, how many values it has.
    parts: Vec<Vec<(u64, usize)>>,
    file_bytes: u64,
}

impl<T: Fixed> Buckets<T> {
    /// Empty buckets that hold at most so many values in memory.
    pub(super) fn new(most: usize) -> Self {
        Buckets {
            held: vec![Vec::new(); BUCKETS],
            count: 0,
            most,
            file: None,
            parts: vec![Vec::new(); BUCKETS],
            file_bytes: 0,
        }
    }

    /// How many bytes are in memory.
    pub(super) fn held_bytes(&self) -> usize {
        self.count * T::BYTES
    }

    /// How many bytes are in the file.
    pub(super) fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    /// Adds a value to a bucket.
    pub(super) fn push(&mut self, bucket: usize, value: T) -> Result<(), LogError> {
        if self.count >= self.most {
            self.write().map_err(|error| refused("write", error))?;
        }
        self.held[bucket].push(value);
        self.count += 1;
        Ok(())
    }

    /// Moves what is in memory to the file.
    fn write(&mut self) -> io::Result<()> {
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(tempfile::tempfile()?),
        };
        file.seek(SeekFrom::Start(self.file_bytes))?;
        let mut bytes = Vec::new();
        for (held, parts) in self.held.iter_mut().zip(&mut self.parts) {
            if held.is_empty() {
                continue;
            }
            bytes.clear();
            for value in &*held {
                value.put(&mut bytes);
            }
            file.write_all(&bytes)?;
            parts.push((self.file_bytes, held.len()));
            self.file_bytes += bytes.len() as u64;
            held.clear();
        }
        self.count = 0;
        Ok(())
    }

    /// All values of a bucket, in the order in which they came.
    pub(super) fn read(&mut self, bucket: usize) -> Result<Vec<T>, LogError> {
        let mut values = Vec::new();
        if let Some(file) = &mut self.file {
            for (start, count) in &self.parts[bucket] {
                let part = read_part(file, *start, *count, &mut values);
                part.map_err(|error| refused("read", error))?;
            }
        }
        values.extend_from_slice(&self.held[bucket]);
        Ok(values)
    }
}

fn read_part<T: Fixed>(
    file: &mut File,
    start: u64,
    count: usize,
    values: &mut Vec<T>,
) -> io::Result<()> {
    let mut bytes = vec![0; count * T::BYTES];
    file.seek(SeekFrom::Start(start))?;
    file.read_exact(&mut bytes)?;
    let mut parser = Parser::new(&bytes);
    values.extend((0..count).filter_map(|_| T::take(&mut parser)));
    Ok(())
}

/// A temporary file that cannot be used, by the folder that it is in.
fn refused(action: &'static str, source: io::Error) -> LogError {
    LogError::Temporary {
        path: std::env::temp_dir(),
        action,
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Fixed for u32 {
        const BYTES: usize = 4;

        fn put(&self, out: &mut Vec<u8>) {
            out.extend_from_slice(&self.to_le_bytes());
        }

        fn take(parser: &mut Parser<'_>) -> Option<Self> {
            parser.u32()
        }
    }

    #[test]
    fn buckets_keep_their_order_wherever_they_are() {
        for most in [1, 7, 100, 10_000] {
            let mut buckets = Buckets::new(most);
            for value in 0..1000u32 {
                buckets.push(value as usize % 3, value).unwrap();
                assert!(buckets.held_bytes() <= 4 * most);
            }
            assert_eq!(buckets.file_bytes() > 0, most < 1000);
            for bucket in 0..3 {
                let expected: Vec<u32> = (bucket as u32..1000).step_by(3).collect();
                assert_eq!(buckets.read(bucket).unwrap(), expected);
            }
            assert!(buckets.read(3).unwrap().is_empty());
        }
    }
}
