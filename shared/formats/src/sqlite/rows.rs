//! A scan of a table: a tree of pages, whose leaves have the rows.
//!
//! | offset | bytes | page header |
//! |---|---|---|
//! | 0 | 1 | kind: 5 inner page, 13 leaf |
//! | 3 | 2 | number of cells |
//! | 8 | 4 | inner pages: the last child |
//! | 8 or 12 | 2 each | offsets of the cells |
//!
//! A cell of an inner page begins with its child. A cell of a leaf is the size of a record, the id of the row, and the
//! record. Long records continue on a chain of other pages.

use super::Database;
use super::error::{Place, SqliteError, SqliteFault};
use super::record::{self, Value, varint};

/// Maximum number of levels of a tree. The largest database has fewer.
const MAX_DEPTH: usize = 32;
const INNER: u8 = 5;
const LEAF: u8 = 13;
/// Size of the file header, which is on page 1.
const FILE_HEADER: usize = 100;

/// A row. Before [`Rows::load`], only the values at its start are available.
#[derive(Debug)]
pub struct Row<'a> {
    database: &'a Database,
    id: i64,
    page: u32,
    n_bytes: usize,
    record: Vec<u8>,
    /// First page with the rest of the record; 0 if the record is complete.
    overflow: u32,
}

impl Row<'_> {
    /// Id of the row; the value of an `INTEGER PRIMARY KEY`.
    pub fn id(&self) -> i64 {
        self.id
    }

    /// Page of the row, counted from 1.
    pub fn page(&self) -> u32 {
        self.page
    }

    /// Value of a column, counted from 0; `None` if the row has fewer columns.
    pub fn value(&self, column: usize) -> Result<Option<Value<'_>>, SqliteError> {
        record::value(&self.record, column).map_err(|fault| self.database.fault(self.page, fault))
    }
}

/// Reads the rows of a table.
#[derive(Debug)]
pub struct Rows<'a> {
    database: &'a Database,
    root: Option<u32>,
    /// Pages from the root to the current leaf.
    stack: Vec<Page>,
    /// Pages that may still be read.
    n_left: u32,
}

#[derive(Debug)]
struct Page {
    number: u32,
    bytes: Vec<u8>,
    kind: u8,
    n_cells: usize,
    /// Cell that comes next.
    next: usize,
    /// Bytes of the rows so far.
    used: usize,
}

impl Page {
    fn begin(&self) -> usize {
        if self.number == 1 { FILE_HEADER } else { 0 }
    }

    fn u16_at(&self, at: usize) -> Result<usize, SqliteFault> {
        let bytes = self.bytes.get(at..at + 2).ok_or(SqliteFault::Outside { what: "a cell" })?;
        Ok(usize::from(u16::from_be_bytes([bytes[0], bytes[1]])))
    }

    /// The next cell, or the last child of an inner page.
    fn next(&mut self) -> Result<Option<usize>, SqliteFault> {
        let begin = self.begin();
        let index = self.next;
        self.next += 1;
        let first = begin + if self.kind == INNER { 12 } else { 8 };
        if index < self.n_cells {
            return self.u16_at(first + 2 * index).map(Some);
        }
        Ok((self.kind == INNER && index == self.n_cells).then_some(begin + 8))
    }
}

fn page_number(bytes: &[u8], at: usize) -> Result<u32, SqliteFault> {
    let number = bytes.get(at..).and_then(|rest| rest.first_chunk());
    number.map(|number| u32::from_be_bytes(*number)).ok_or(SqliteFault::Outside { what: "a link" })
}

impl<'a> Rows<'a> {
    pub(super) fn new(database: &'a Database, root: u32) -> Self {
        Self { database, root: Some(root), stack: Vec::new(), n_left: database.header.n_pages }
    }

    /// The next row; `None` at the end.
    pub fn next_row(&mut self) -> Result<Option<Row<'a>>, SqliteError> {
        if let Some(root) = self.root.take() {
            self.push(root, Place { page: 1 })?;
        }
        while let Some(page) = self.stack.last_mut() {
            let number = page.number;
            let kind = page.kind;
            let fault = |fault: SqliteFault| self.database.fault(number, fault);
            let Some(at) = page.next().map_err(fault)? else {
                self.stack.pop();
                continue;
            };
            if kind == LEAF {
                return self.row(number, at).map(Some).map_err(fault);
            }
            let child = page_number(&page.bytes, at).map_err(fault)?;
            self.push(child, Place { page: number })?;
        }
        Ok(None)
    }

    /// Reads the rest of a row that this scan returned.
    pub fn load(&mut self, row: &mut Row<'a>) -> Result<(), SqliteError> {
        while row.record.len() < row.n_bytes {
            let bytes = self.page(row.overflow, Place { page: row.page })?;
            let fault = |fault: SqliteFault| self.database.fault(row.page, fault);
            let next = page_number(&bytes, 0).map_err(fault)?;
            let n_bytes = (row.n_bytes - row.record.len()).min(bytes.len() - 4);
            row.record.extend(&bytes[4..4 + n_bytes]);
            row.overflow = next;
        }
        Ok(())
    }

    /// Reads a page. Each page belongs to one place of one table, so an undamaged scan reads it once.
    fn page(&mut self, number: u32, from: Place) -> Result<Vec<u8>, SqliteError> {
        let n_pages = self.database.header.n_pages;
        let left = self.n_left.checked_sub(1);
        self.n_left = left.ok_or_else(|| self.database.fault(from.page, SqliteFault::Circle(n_pages)))?;
        self.database.page(number, from)
    }

    fn push(&mut self, number: u32, from: Place) -> Result<(), SqliteError> {
        let fault = |fault: SqliteFault| self.database.fault(number, fault);
        if self.stack.len() >= MAX_DEPTH {
            return Err(fault(SqliteFault::Circle(self.database.header.n_pages)));
        }
        let bytes = self.page(number, from)?;
        let mut page = Page { number, bytes, kind: 0, n_cells: 0, next: 0, used: 0 };
        page.kind = page.bytes[page.begin()];
        if page.kind != INNER && page.kind != LEAF {
            return Err(fault(SqliteFault::Kind(page.kind)));
        }
        page.n_cells = page.u16_at(page.begin() + 3).map_err(fault)?;
        self.stack.push(page);
        Ok(())
    }

    /// The row of a cell on the current leaf.
    fn row(&mut self, number: u32, at: usize) -> Result<Row<'a>, SqliteFault> {
        let outside = || SqliteFault::Outside { what: "a row" };
        let page = self.stack.last_mut().ok_or_else(outside)?;
        let cell = page.bytes.get(at..).ok_or_else(outside)?;
        let (length, n) = varint(cell)?;
        let (id, m) = varint(&cell[n..])?;
        let header = &self.database.header;
        let file_bytes = u64::from(header.n_pages) * header.page_bytes as u64;
        if length > file_bytes {
            return Err(SqliteFault::RowSize(length));
        }
        let cell = &cell[n + m..];
        let length = length as usize;
        let local = local_bytes(length, header.usable_bytes());
        let record = cell.get(..local).ok_or_else(outside)?.to_vec();
        // Overlapping rows would make a scan longer than the file.
        page.used += local;
        if page.used > page.bytes.len() {
            return Err(outside());
        }
        let overflow = if length > local { page_number(cell, local)? } else { 0 };
        Ok(Row { database: self.database, id: id as i64, page: number, n_bytes: length, record, overflow })
    }
}

/// Bytes of a record of `length` bytes that are on the leaf.
fn local_bytes(length: usize, usable: usize) -> usize {
    let max = usable - 35;
    if length <= max {
        return length;
    }
    let min = (usable - 12) * 32 / 255 - 23;
    let fits = min + (length - min) % (usable - 4);
    if fits <= max { fits } else { min }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    const PAGE: usize = 512;

    /// A page of cells, which are placed from its end.
    fn page(begin: usize, kind: u8, last_child: Option<u32>, cells: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = vec![0; PAGE];
        bytes[begin] = kind;
        bytes[begin + 3..begin + 5].copy_from_slice(&(cells.len() as u16).to_be_bytes());
        let mut pointer = begin + 8;
        if let Some(child) = last_child {
            bytes[pointer..pointer + 4].copy_from_slice(&child.to_be_bytes());
            pointer += 4;
        }
        let mut end = PAGE;
        for cell in cells {
            end -= cell.len();
            bytes[end..end + cell.len()].copy_from_slice(cell);
            bytes[pointer..pointer + 2].copy_from_slice(&(end as u16).to_be_bytes());
            pointer += 2;
        }
        bytes
    }

    /// A row of one blob that fits its page.
    fn row(id: u8, blob: &[u8]) -> Vec<u8> {
        [&[blob.len() as u8 + 2, id, 2, blob.len() as u8 * 2 + 12][..], blob].concat()
    }

    /// A row of one blob of 600 bytes that continues on page `next`: 94 bytes of the record are here.
    fn long_row(id: u8, next: u32) -> Vec<u8> {
        // 603 bytes of record: header of 3 with kind 1212, then the blob.
        let mut cell = vec![0x84, 0x5b, id, 3, 0x89, 0x3c];
        cell.extend([id; 92]);
        cell.extend(next.to_be_bytes());
        cell
    }

    /// A database whose table `t` has its root on page 2, and these further pages.
    fn database(pages: &[Vec<u8>]) -> (tempfile::TempDir, PathBuf) {
        let mut schema = vec![6, 23, 15, 13, 1, 0];
        schema.extend(b"table");
        schema.extend(b"t");
        schema.push(2);
        let mut cell = vec![schema.len() as u8, 1];
        cell.extend(&schema);
        let mut bytes = page(FILE_HEADER, LEAF, None, &[cell]);
        bytes[..16].copy_from_slice(b"SQLite format 3\0");
        bytes[16..18].copy_from_slice(&(PAGE as u16).to_be_bytes());
        bytes[28..32].copy_from_slice(&(1 + pages.len() as u32).to_be_bytes());
        bytes[56..60].copy_from_slice(&1_u32.to_be_bytes());
        bytes.extend(pages.concat());
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.db3");
        std::fs::write(&path, bytes).expect("writes");
        (folder, path)
    }

    /// Ids and blobs of all rows of `t`.
    fn read(pages: &[Vec<u8>]) -> Result<Vec<(i64, Vec<u8>)>, SqliteError> {
        let (_folder, path) = database(pages);
        let database = Database::open(&path)?;
        let mut rows = database.rows("t")?.expect("has the table");
        let mut found = Vec::new();
        while let Some(mut row) = rows.next_row()? {
            rows.load(&mut row)?;
            let Some(Value::Blob(blob)) = row.value(0)? else { panic!("no blob") };
            found.push((row.id(), blob.to_vec()));
        }
        Ok(found)
    }

    #[test]
    fn rows_of_all_leaves_are_read_with_their_overflow() {
        let child = |page: u32, last: u8| [&page.to_be_bytes()[..], &[last]].concat();
        let pages = [
            page(0, INNER, Some(4), &[child(3, 2)]),
            page(0, LEAF, None, &[row(1, b"one"), row(2, b"")]),
            page(0, LEAF, None, &[long_row(7, 5)]),
            [&[0; 4][..], &[7; 508]].concat(),
        ];
        let found = read(&pages).expect("reads");
        assert_eq!(found, [(1, b"one".to_vec()), (2, Vec::new()), (7, vec![7; 600])]);
    }

    #[test]
    fn damaged_links_end_the_scan() {
        let itself = page(0, INNER, Some(2), &[]);
        assert!(matches!(read(&[itself]).expect_err("is a circle").fault, SqliteFault::Circle(2)));
        let outside = page(0, INNER, Some(9), &[]);
        let error = read(&[outside]).expect_err("is outside").to_string();
        assert!(error.ends_with("page 2: a link leads to page 9; the file has pages 1 to 2"), "{error}");
        let index = page(0, 10, None, &[]);
        assert!(matches!(read(&[index]).expect_err("is not a table").fault, SqliteFault::Kind(10)));
        let long = page(0, LEAF, None, &[long_row(1, 9)]);
        assert!(matches!(read(&[long]).expect_err("is outside").fault, SqliteFault::Link { number: 9, .. }));
        let mut far = page(0, LEAF, None, &[row(1, b"one")]);
        far[8..10].copy_from_slice(&511_u16.to_be_bytes());
        assert!(matches!(read(&[far]).expect_err("is outside").fault, SqliteFault::Outside { .. }));
    }

    #[test]
    fn rows_that_overlap_are_refused() {
        let mut leaf = page(0, LEAF, None, &[row(1, &[1; 50])]);
        leaf[3..5].copy_from_slice(&20_u16.to_be_bytes());
        let at = [leaf[8], leaf[9]];
        (0..20).for_each(|index| leaf[8 + 2 * index..10 + 2 * index].copy_from_slice(&at));
        assert!(matches!(read(&[leaf]).expect_err("overlap").fault, SqliteFault::Outside { what: "a row" }));
    }

    #[test]
    fn headers_of_other_databases_are_refused() {
        let (_folder, path) = database(&[page(0, LEAF, None, &[])]);
        let good = std::fs::read(&path).expect("reads");
        for (at, value, words) in [
            (0, 0, "not an SQLite 3 database"),
            (16, 3, "page size 768"),
            (59, 2, "text encoding 2; must be 1, UTF-8"),
            (31, 9, "the file has 1024 bytes, its header says 9 pages of 512 bytes; was it cut?"),
        ] {
            let mut bytes = good.clone();
            bytes[at] = value;
            std::fs::write(&path, bytes).expect("writes");
            let error = Database::open(&path).expect_err(words).to_string();
            assert!(error.contains(words), "{error}");
        }
        std::fs::write(&path, &good[..50]).expect("writes");
        assert!(Database::open(&path).is_err());
        std::fs::write(&path, &good).expect("writes");
        assert!(Database::open(&path).expect("opens").rows("other").expect("reads").is_none());
        std::fs::write(path.with_file_name("a.db3-wal"), [0; 33]).expect("writes");
        assert!(Database::open(&path).expect_err("is not closed").to_string().contains("PRAGMA"));
    }
}
