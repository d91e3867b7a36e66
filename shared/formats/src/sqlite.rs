//! Tables of `SQLite` 3 databases (<https://www.sqlite.org/fileformat2.html>), row by row: enough for ROS 2 bags.
//!
//! Read: tables with a rowid in UTF-8 databases. Refused: databases with a write-ahead log or a rollback journal, because
//! the file does not contain all rows. A scan reads each page at most once, so damaged links end it.
//!
//! Not based on the C library: it takes a minute to compile, and rows are only needed in the order of the file.

mod error;
mod header;
mod record;
mod rows;

pub use error::{SqliteError, SqliteFault};
pub use record::Value;
pub use rows::{Row, Rows};

use error::Place;
use files::regular_file;
use header::Header;
use std::fs::File;
use std::io::{self, ErrorKind};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Maximum number of tables of a schema; a ROS 2 bag has four.
const MAX_TABLES: usize = 10_000;

/// A database opened for reading.
#[derive(Debug)]
pub struct Database {
    path: PathBuf,
    file: File,
    header: Header,
}

impl Database {
    /// Opens a database.
    pub fn open(path: &Path) -> Result<Self, SqliteError> {
        let fault = |fault: SqliteFault| SqliteError { path: path.to_owned(), page: 1, fault };
        for (suffix, n_empty) in [("-wal", header::WAL_HEADER), ("-journal", 0)] {
            let mut name = path.as_os_str().to_owned();
            name.push(suffix);
            match std::fs::metadata(&name) {
                Ok(metadata) if metadata.len() > n_empty => return Err(fault(SqliteFault::Unfinished(name.into()))),
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(fault(error.into())),
                _ => {}
            }
        }
        let file = regular_file::open(path).map_err(|error| fault(error.into()))?;
        let n_bytes = file.metadata().map_err(|error| fault(error.into()))?.len();
        let mut bytes = [0; header::HEADER];
        match file.read_exact_at(&mut bytes, 0) {
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Err(fault(SqliteFault::NotADatabase)),
            read => read.map_err(|error| fault(error.into()))?,
        }
        let header = Header::parse(&bytes, n_bytes).map_err(fault)?;
        Ok(Self { path: path.to_owned(), file, header })
    }

    /// The rows of a table in the order of their ids. `None` if there is no such table.
    pub fn rows(&self, table: &str) -> Result<Option<Rows<'_>>, SqliteError> {
        let mut schema = Rows::new(self, 1);
        for _ in 0..MAX_TABLES {
            let Some(mut row) = schema.next_row()? else { break };
            schema.load(&mut row)?;
            let is_table = row.value(0)? == Some(Value::Text(b"table"));
            if is_table && row.value(1)? == Some(Value::Text(table.as_bytes())) {
                let root = match row.value(3)? {
                    Some(Value::Int(root)) => u32::try_from(root).ok(),
                    _ => None,
                };
                let root = root.ok_or_else(|| self.fault(row.page(), SqliteFault::Root(table.to_owned())))?;
                return Ok(Some(Rows::new(self, root)));
            }
        }
        Ok(None)
    }

    fn fault(&self, page: u32, fault: SqliteFault) -> SqliteError {
        SqliteError { path: self.path.clone(), page, fault }
    }

    /// The content of a page, counted from 1.
    fn page(&self, number: u32, from: Place) -> Result<Vec<u8>, SqliteError> {
        if number == 0 || number > self.header.n_pages {
            let n_pages = self.header.n_pages;
            return Err(self.fault(from.page, SqliteFault::Link { number, n_pages }));
        }
        let mut bytes = vec![0; self.header.page_bytes];
        let at = u64::from(number - 1) * self.header.page_bytes as u64;
        let read = self.file.read_exact_at(&mut bytes, at);
        read.map_err(|error: io::Error| self.fault(number, error.into()))?;
        bytes.truncate(self.header.usable_bytes());
        Ok(bytes)
    }
}
