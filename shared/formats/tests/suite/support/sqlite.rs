//! Reads the rows of a table of a database of `SQLite` (<https://www.sqlite.org/fileformat2.html>), enough for ROS 2 bags.

/// A value of a row.
#[derive(Clone, Debug)]
pub enum Value {
    /// NULL, or a kind that bags do not have.
    None,
    Int(i64),
    Bytes(Vec<u8>),
}

pub struct Database {
    bytes: Vec<u8>,
    page_size: usize,
}

fn varint(bytes: &[u8]) -> (u64, usize) {
    let mut value = 0;
    for (index, byte) in bytes.iter().enumerate().take(9) {
        if index == 8 {
            return (value << 8 | u64::from(*byte), 9);
        }
        value = value << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return (value, index + 1);
        }
    }
    panic!("a number ends inside")
}

fn be(bytes: &[u8]) -> i64 {
    let first = if bytes.first().is_some_and(|byte| byte & 0x80 != 0) { -1 } else { 0 };
    bytes.iter().fold(first, |sum, byte| sum << 8 | i64::from(*byte))
}

impl Database {
    pub fn open(path: &std::path::Path) -> Self {
        let bytes = std::fs::read(path).expect("a database");
        assert!(bytes.starts_with(b"SQLite format 3\0"));
        let page_size = usize::from(u16::from_be_bytes([bytes[16], bytes[17]]));
        Self { bytes, page_size }
    }

    /// The rows of a table, in order.
    pub fn rows(&self, table: &str) -> Vec<Vec<Value>> {
        let is_table = |row: &&Vec<Value>| matches!(&row[1], Value::Bytes(name) if name == table.as_bytes());
        let schema = self.tree(1);
        let row = schema.iter().find(is_table).expect("the table");
        let Value::Int(root) = row[3] else { panic!("no root page") };
        self.tree(root as usize)
    }

    fn page(&self, number: usize) -> &[u8] {
        &self.bytes[(number - 1) * self.page_size..][..self.page_size]
    }

    fn tree(&self, number: usize) -> Vec<Vec<Value>> {
        let page = self.page(number);
        let head = if number == 1 { 100 } else { 0 };
        let u16_at = |at: usize| usize::from(u16::from_be_bytes([page[at], page[at + 1]]));
        let u32_at = |at: usize| u32::from_be_bytes([page[at], page[at + 1], page[at + 2], page[at + 3]]) as usize;
        let (kind, n_cells) = (page[head], u16_at(head + 3));
        let first = head + if kind == 5 { 12 } else { 8 };
        let cells = (0..n_cells).map(|index| u16_at(first + 2 * index));
        match kind {
            5 => cells.map(u32_at).chain([u32_at(head + 8)]).flat_map(|child| self.tree(child)).collect(),
            13 => cells.map(|at| self.row(&page[at..])).collect(),
            _ => panic!("page {number} is of kind {kind}"),
        }
    }

    fn row(&self, cell: &[u8]) -> Vec<Value> {
        let (length, n) = varint(cell);
        let (_, m) = varint(&cell[n..]);
        let (cell, length) = (&cell[n + m..], length as usize);
        let (usable, max) = (self.page_size, self.page_size - 35);
        let min = (usable - 12) * 32 / 255 - 23;
        let fits = min + length.saturating_sub(min) % (usable - 4);
        let local = if length <= max {
            length
        } else if fits <= max {
            fits
        } else {
            min
        };
        let mut record = cell[..local].to_vec();
        let mut next = if length > local { be(&cell[local..local + 4]) as usize } else { 0 };
        while record.len() < length {
            let page = self.page(next);
            let n_bytes = (length - record.len()).min(usable - 4);
            record.extend(&page[4..4 + n_bytes]);
            next = be(&page[..4]) as usize;
        }
        let (header, n) = varint(&record);
        let (mut kinds, mut values) = (&record[n..header as usize], &record[header as usize..]);
        let mut row = Vec::new();
        while !kinds.is_empty() {
            let (kind, n) = varint(kinds);
            kinds = &kinds[n..];
            let n_bytes = match kind {
                0 | 8 | 9 => 0,
                1..=4 => kind as usize,
                5 => 6,
                6 | 7 => 8,
                text_or_blob => (text_or_blob as usize - 12) / 2,
            };
            let (bytes, rest) = values.split_at(n_bytes);
            row.push(match kind {
                1..=6 => Value::Int(be(bytes)),
                8 | 9 => Value::Int(kind as i64 - 8),
                12.. => Value::Bytes(bytes.to_vec()),
                _ => Value::None,
            });
            values = rest;
        }
        row
    }
}
