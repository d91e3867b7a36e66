//! The subset of requests of the kernel to a file system in user space (`/dev/fuse`, `linux/fuse.h`) that the programs
//! need.

/// Protocol version of this file: 7.31.
const VERSION: [u32; 2] = [7, 31];
/// Bytes of a request's header.
const IN_HEADER: usize = 40;
/// Largest data of a request.
pub(super) const MAX_WRITE: u32 = 1 << 20;
/// Flags of the first answer: writes beyond a page, and up to [`MAX_WRITE`] bytes.
const INIT_FLAGS: u32 = 1 << 5 | 1 << 22;
/// Validity of the kernel's copies of names and sizes, s: only the kernel changes the files.
const VALID_S: u64 = 3600;

/// Errors with the kernel's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Errno {
    NoEntry = 2,
    Exists = 17,
    NotADirectory = 20,
    NotEmpty = 39,
    NotImplemented = 38,
}

/// The requests of the kernel. Files and folders have numbers; 1 is the root.
#[derive(Debug)]
pub(super) enum Request<'a> {
    Init,
    /// A request without an answer.
    Forget,
    Lookup {
        folder: u64,
        name: &'a str,
    },
    Attributes {
        node: u64,
    },
    Resize {
        node: u64,
        size: Option<u64>,
        mode: Option<u32>,
    },
    MakeFolder {
        folder: u64,
        name: &'a str,
        mode: u32,
    },
    MakeFile {
        folder: u64,
        name: &'a str,
        mode: u32,
        is_opened: bool,
    },
    Remove {
        folder: u64,
        name: &'a str,
        is_folder: bool,
    },
    Rename {
        folder: u64,
        name: &'a str,
        to_folder: u64,
        to_name: &'a str,
    },
    Open,
    Read {
        node: u64,
        at: u64,
        size: u32,
    },
    Write {
        node: u64,
        at: u64,
        bytes: &'a [u8],
    },
    Capacity,
    /// Nothing to do, but it must succeed.
    Done,
    SyncFile {
        node: u64,
    },
    SyncFolder {
        node: u64,
    },
    List {
        node: u64,
        at: u64,
        size: u32,
    },
    Unknown,
}

/// A request and its number.
pub(super) fn parse(bytes: &[u8]) -> Option<(u64, Request<'_>)> {
    let (header, body) = bytes.split_at_checked(IN_HEADER)?;
    let code = u32_at(header, 4)?;
    let unique = u64_at(header, 8)?;
    let node = u64_at(header, 16)?;
    Some((unique, request(code, node, body).unwrap_or(Request::Unknown)))
}

fn request(code: u32, node: u64, body: &[u8]) -> Option<Request<'_>> {
    let folder = node;
    let rename = |at: usize| {
        let (name, rest) = split_name(body.get(at..)?)?;
        let (to_name, _) = split_name(rest)?;
        Some(Request::Rename { folder, name, to_folder: u64_at(body, 0)?, to_name })
    };
    let name = |at: usize| Some(split_name(body.get(at..)?)?.0);
    Some(match code {
        1 => Request::Lookup { folder, name: name(0)? },
        2 | 36 | 42 => Request::Forget,
        3 => Request::Attributes { node },
        4 => {
            let valid = u32_at(body, 0)?;
            let size = (valid & 1 << 3 != 0).then(|| u64_at(body, 16)).flatten();
            let mode = (valid & 1 != 0).then(|| u32_at(body, 68)).flatten();
            Request::Resize { node, size, mode }
        }
        8 => Request::MakeFile { folder, name: name(16)?, mode: u32_at(body, 0)?, is_opened: false },
        9 => Request::MakeFolder { folder, name: name(8)?, mode: u32_at(body, 0)? },
        10 | 11 => Request::Remove { folder, name: name(0)?, is_folder: code == 11 },
        12 => rename(8)?,
        // Only plain renames: no exchange, no "only if absent".
        45 if u32_at(body, 8)? == 0 => rename(16)?,
        14 | 27 => Request::Open,
        15 => Request::Read { node, at: u64_at(body, 8)?, size: u32_at(body, 16)? },
        16 => {
            let size = u32_at(body, 16)? as usize;
            Request::Write { node, at: u64_at(body, 8)?, bytes: body.get(40..40 + size)? }
        }
        17 => Request::Capacity,
        18 | 25 | 29 | 38 => Request::Done,
        20 => Request::SyncFile { node },
        26 => Request::Init,
        28 => Request::List { node, at: u64_at(body, 8)?, size: u32_at(body, 16)? },
        30 => Request::SyncFolder { node },
        35 => Request::MakeFile { folder, name: name(16)?, mode: u32_at(body, 4)?, is_opened: true },
        _ => return None,
    })
}

fn split_name(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let end = bytes.iter().position(|byte| *byte == 0)?;
    Some((std::str::from_utf8(&bytes[..end]).ok()?, &bytes[end + 1..]))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?))
}

/// Attributes of a file or folder for the kernel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attributes {
    pub(super) node: u64,
    pub(super) size: u64,
    /// Kind and permissions.
    pub(super) mode: u32,
}

/// The bytes of an answer.
#[derive(Default)]
pub(super) struct Answer(Vec<u8>);

impl Answer {
    /// The bytes with their header.
    pub(super) fn into_message(self, unique: u64) -> Vec<u8> {
        message(unique, 0, &self.0)
    }
    pub(super) fn u32s(mut self, values: &[u32]) -> Self {
        self.0.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        self
    }
    pub(super) fn u64s(mut self, values: &[u64]) -> Self {
        self.0.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        self
    }
    pub(super) fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend_from_slice(bytes);
        self
    }
    pub(super) fn init() -> Self {
        let [major, minor] = VERSION;
        let pages = MAX_WRITE / 4096;
        // Versions, read-ahead, flags, background requests, largest write, resolution of times, pages of a request.
        Self::default().u32s(&[major, minor, 1 << 17, INIT_FLAGS, 16 << 16 | 16, MAX_WRITE, 1, pages, 0]).u32s(&[0; 7])
    }
    fn described(self, found: Attributes) -> Self {
        let blocks = found.size.div_ceil(512);
        let described = self.u64s(&[found.node, found.size, blocks, 0, 0, 0]);
        // Three times, mode, links, owner, group, device, block size, flags: the owner is the root of the namespace.
        described.u32s(&[0, 0, 0, found.mode, 1, 0, 0, 0, 4096, 0])
    }
    pub(super) fn entry(found: Attributes) -> Self {
        Self::default().u64s(&[found.node, 0, VALID_S, VALID_S]).u32s(&[0, 0]).described(found)
    }
    pub(super) fn attributes(found: Attributes) -> Self {
        Self::default().u64s(&[VALID_S]).u32s(&[0, 0]).described(found)
    }
    /// Adds a handle, which is unused.
    pub(super) fn opened(self) -> Self {
        self.u64s(&[0, 0])
    }
    pub(super) fn capacity() -> Self {
        let n = 1 << 28;
        Self::default().u64s(&[n, n, n, n, n]).u32s(&[4096, 255, 4096, 0, 0, 0, 0, 0, 0, 0])
    }
    /// Adds an entry of a folder unless it would be longer than `size`. `at`: position at which the list continues
    /// after it.
    pub(super) fn listed(mut self, size: usize, at: u64, name: &str, found: Attributes) -> (Self, bool) {
        let length = (24 + name.len()).next_multiple_of(8);
        if self.0.len() + length > size {
            return (self, false);
        }
        let end = self.0.len() + length;
        self = self.u64s(&[found.node, at]).u32s(&[name.len() as u32, found.mode >> 12]).bytes(name.as_bytes());
        self.0.resize(end, 0);
        (self, true)
    }
}

/// An answer with an error.
pub(super) fn refusal(unique: u64, errno: Errno) -> Vec<u8> {
    message(unique, -(errno as i32), &[])
}

fn message(unique: u64, error: i32, body: &[u8]) -> Vec<u8> {
    let mut bytes = ((16 + body.len()) as u32).to_le_bytes().to_vec();
    bytes.extend(error.to_le_bytes());
    bytes.extend(unique.to_le_bytes());
    bytes.extend_from_slice(body);
    bytes
}
