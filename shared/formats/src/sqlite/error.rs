//! Errors of databases.

use std::io;
use std::path::PathBuf;

/// Error of a database that cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{path}: page {page}: {fault}", path = path.display())]
pub struct SqliteError {
    /// The file.
    pub path: PathBuf,
    /// Page, counted from 1.
    pub page: u32,
    /// Fault of the page.
    pub fault: SqliteFault,
}

/// Fault of a database.
#[derive(Debug, thiserror::Error)]
pub enum SqliteFault {
    /// The operating system reported an error.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Another file contains rows of the database.
    #[error(
        "{path} has rows that are not in the database: it was not closed; run `sqlite3 FILE 'PRAGMA journal_mode=DELETE'`",
        path = .0.display()
    )]
    Unfinished(PathBuf),
    /// The first bytes are not the magic string.
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
        /// Number of pages in the header.
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
    /// The links of pages form a cycle.
    #[error("a table has more pages than the file, {0}: its links form a cycle")]
    Circle(u32),
    /// The page is not a page of a table.
    #[error("page of kind {0}; pages of tables are of kind 5 or 13")]
    Kind(u8),
    /// A value lies outside of its page or record.
    #[error("{what} ends outside of the page or the row")]
    Outside {
        /// Name of the value.
        what: &'static str,
    },
    /// A row is larger than the file.
    #[error("a row of {0} bytes is larger than the file")]
    RowSize(u64),
}

/// Location of a link.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub page: u32,
}
