//! The header of a database: the first 100 bytes.
//!
//! | offset | bytes | value |
//! |---|---|---|
//! | 0 | 16 | `SQLite format 3` and a zero |
//! | 16 | 2 | bytes of a page, 1 for 65536 |
//! | 20 | 1 | unused bytes at the end of each page |
//! | 28 | 4 | pages of the file |
//! | 56 | 4 | text encoding, 1 for UTF-8; 0 in an empty database |

use super::error::SqliteFault;

/// Bytes of the header.
pub(super) const HEADER: usize = 100;
/// Bytes of the header of a write-ahead log. A log without rows is not longer.
pub(super) const WAL_HEADER: u64 = 32;

const MAGIC: &[u8] = b"SQLite format 3\0";

/// Properties needed to read the pages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Header {
    pub page_bytes: usize,
    pub reserved_bytes: usize,
    pub n_pages: u32,
}

impl Header {
    pub fn parse(bytes: &[u8; HEADER], file_bytes: u64) -> Result<Self, SqliteFault> {
        if !bytes.starts_with(MAGIC) {
            return Err(SqliteFault::NotADatabase);
        }
        let u32_at = |at: usize| u32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let page_bytes = match u16::from_be_bytes([bytes[16], bytes[17]]) {
            1 => 65_536,
            size => usize::from(size),
        };
        let reserved_bytes = usize::from(bytes[20]);
        // The file format requires at least 480 usable bytes.
        if !page_bytes.is_power_of_two() || page_bytes < 512 || page_bytes - reserved_bytes < 480 {
            return Err(SqliteFault::PageSize { page_bytes, reserved_bytes });
        }
        let encoding = u32_at(56);
        if encoding > 1 {
            return Err(SqliteFault::Encoding(encoding));
        }
        let n_pages = u32_at(28);
        let found = u32::try_from(file_bytes / page_bytes as u64).unwrap_or(u32::MAX);
        // Versions before 3.7 leave 0.
        if n_pages > found || found == 0 {
            return Err(SqliteFault::Cut { found_bytes: file_bytes, n_pages, page_bytes });
        }
        Ok(Self { page_bytes, reserved_bytes, n_pages: if n_pages == 0 { found } else { n_pages } })
    }

    pub fn usable_bytes(&self) -> usize {
        self.page_bytes - self.reserved_bytes
    }
}
