//! Directories of TIFF files (TIFF 6.0) and of `BigTIFF` files, whose offsets have 64 bits.

/// TIFF variant of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layout {
    /// Offsets of 32 bits, readable by all programs.
    Classic,
    /// Offsets of 64 bits, for files of more than 4 GiB.
    Big,
}

impl Layout {
    /// The first bytes of a file; the first directory follows.
    pub(super) fn signature(self) -> &'static [u8] {
        match self {
            Self::Classic => b"II*\0\x08\0\0\0",
            Self::Big => b"II+\0\x08\0\0\0\x10\0\0\0\0\0\0\0",
        }
    }
    /// Bytes of an offset, of the number of values, and of a value inside an entry.
    const fn word_bytes(self) -> usize {
        match self {
            Self::Classic => 4,
            Self::Big => 8,
        }
    }
    /// Bytes of the number of entries.
    const fn count_bytes(self) -> usize {
        match self {
            Self::Classic => 2,
            Self::Big => 8,
        }
    }
    /// A number in `n_bytes`. Offsets in classic files fit, see [`super::geotiff`].
    fn number(value: u64, n_bytes: usize) -> impl Iterator<Item = u8> {
        value.to_le_bytes().into_iter().take(n_bytes)
    }
    fn word(self, value: u64) -> impl Iterator<Item = u8> {
        Self::number(value, self.word_bytes())
    }
}

/// Entries of a directory, in increasing order of their numbers.
pub(super) struct Tags {
    layout: Layout,
    entries: Vec<Entry>,
}

struct Entry {
    tag: u16,
    kind: u16,
    n: u64,
    values: Vec<u8>,
}

impl Tags {
    pub(super) fn new(layout: Layout) -> Self {
        Self { layout, entries: Vec::new() }
    }

    fn push(&mut self, tag: u16, kind: u16, n: usize, values: Vec<u8>) {
        self.entries.push(Entry { tag, kind, n: n as u64, values });
    }
    pub(super) fn shorts(&mut self, tag: u16, values: &[u16]) {
        self.push(tag, 3, values.len(), values.iter().flat_map(|value| value.to_le_bytes()).collect());
    }
    pub(super) fn longs(&mut self, tag: u16, values: &[u32]) {
        self.push(tag, 4, values.len(), values.iter().flat_map(|value| value.to_le_bytes()).collect());
    }
    /// Adds a tag with offsets in the file.
    pub(super) fn places(&mut self, tag: u16, places: &[u64]) {
        let kind = if self.layout == Layout::Big { 16 } else { 4 };
        let values = places.iter().flat_map(|place| self.layout.word(*place)).collect();
        self.push(tag, kind, places.len(), values);
    }
    pub(super) fn doubles(&mut self, tag: u16, values: &[f64]) {
        self.push(tag, 12, values.len(), values.iter().flat_map(|value| value.to_le_bytes()).collect());
    }
    pub(super) fn text(&mut self, tag: u16, text: &str) {
        self.push(tag, 2, text.len() + 1, [text.as_bytes(), b"\0"].concat());
    }

    /// The directory at byte `at`: entries, offset of the next directory, then values that do not fit into an entry.
    pub(super) fn bytes(self, at: u64, is_last: bool) -> Vec<u8> {
        let Self { layout, entries } = self;
        let entry_bytes = 4 + 2 * layout.word_bytes();
        let head_bytes = layout.count_bytes() + entry_bytes * entries.len() + layout.word_bytes();
        let mut head = Vec::with_capacity(head_bytes);
        let mut tail = Vec::new();
        head.extend(Layout::number(entries.len() as u64, layout.count_bytes()));
        for Entry { tag, kind, n, mut values } in entries {
            head.extend(tag.to_le_bytes());
            head.extend(kind.to_le_bytes());
            head.extend(layout.word(n));
            if values.len() <= layout.word_bytes() {
                values.resize(layout.word_bytes(), 0);
                head.extend(values);
            } else {
                head.extend(layout.word(at + (head_bytes + tail.len()) as u64));
                // Values start at even bytes.
                values.resize(values.len().next_multiple_of(2), 0);
                tail.extend(values);
            }
        }
        let next = if is_last { 0 } else { at + (head_bytes + tail.len()) as u64 };
        head.extend(layout.word(next));
        head.extend(tail);
        head
    }
}
