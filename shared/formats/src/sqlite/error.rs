//! Errors of databases.

use std::io;
use std::path::PathBuf;

/// A database that cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{path}: page {page}: {fault}", path = path.display())]
pub struct SqliteError {
    /// The file.
    pub path: PathBuf,
    /// Counted from 1.
    pub page: u32,
    /// What is wrong.
    pub fault: SqliteFault,
}

/// What is wrong with a database.
#[derive(Debug, thiserror::Error)]
pub enum SqliteFault {
    /// The operating system reported an error.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Rows are in another file.
    #[error(
        "{path} has rows that are not in the database: it was not closed; run `sqlite3 FILE 'PRAGMA journal_mode=DELETE'`",
        path = .0.display()
    )]
    Unfinished(PathBuf),
    /// The first bytes are others.
    #[error("not an SQLite 3 database")]
    NotADatabase,
    /// The size of pages is invalid.
    #[error(
        "page size {page_bytes} with {reserved_bytes} reserved bytes; must be a power of two from 512 to 65536, at most 255 reserved"
    )]
    PageSize {
        /// Bytes of a page.
        page_bytes: usize,
        /// Unused bytes at the end of each page.
        reserved_bytes: usize,
    },
    /// The text encoding is not supported.
    #[error("text encoding {0}; must be 1, UTF-8")]
    Encoding(u32),
    /// The file ends early.
    #[error("the file has {found_bytes} bytes, its header says {n_pages} pages of {page_bytes} bytes; was it cut?")]
    Cut {
        /// Size of the file.
        found_bytes: u64,
        /// Pages by the header.
        n_pages: u32,
        /// Bytes of a page.
        page_bytes: usize,
    },
    /// A table has no valid root page.
    #[error("table {0} has no root page")]
    Root(String),
    /// A link leads outside of the file.
    #[error("a link leads to page {number}; the file has pages 1 to {n_pages}")]
    Link {
        /// Page of the link.
        number: u32,
        /// Pages of the file.
        n_pages: u32,
    },
    /// Pages are linked in a circle.
    #[error("a table has more pages than the file, {0}: its links form a circle")]
    Circle(u32),
    /// The page is no page of a table.
    #[error("page of kind {0}; pages of tables are of kind 5 or 13")]
    Kind(u8),
    /// A value lies outside of its page or record.
    #[error("{what} ends outside of the page or the row")]
    Outside {
        /// The value.
        what: &'static str,
    },
    /// A row is larger than the file.
    #[error("a row of {0} bytes is larger than the file")]
    RowSize(u64),
}

/// Where a link stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub page: u32,
}
