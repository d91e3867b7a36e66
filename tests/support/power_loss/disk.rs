//! The content of a disk and the order of its changes.

use super::protocol::{Answer, Attributes, Errno, Request};
use std::collections::BTreeMap;

/// The root folder.
pub(super) const ROOT: u64 = 1;
const FOLDER: u32 = 0o040_000;
const FILE: u32 = 0o100_000;

/// A change of the disk, or a request that changes must be on it.
#[derive(Clone, Debug)]
pub(super) enum Change {
    Create { folder: u64, name: String, node: u64, is_folder: bool, mode: u32 },
    Remove { folder: u64, name: String },
    Rename { folder: u64, name: String, to_name: String, node: u64 },
    Write { node: u64, at: usize, bytes: Vec<u8> },
    Resize { node: u64, size: usize },
    SyncFile { node: u64 },
    SyncFolder { node: u64 },
}

impl Change {
    /// The file whose content changes or the folder whose entries change, or which is synced.
    pub(super) fn changed(&self) -> u64 {
        match self {
            Self::Create { folder, .. } | Self::Remove { folder, .. } | Self::Rename { folder, .. } => *folder,
            Self::Write { node, .. }
            | Self::Resize { node, .. }
            | Self::SyncFile { node }
            | Self::SyncFolder { node } => *node,
        }
    }
    pub(super) fn is_sync(&self) -> bool {
        matches!(self, Self::SyncFile { .. } | Self::SyncFolder { .. })
    }
    /// Changes the content of its file.
    pub(super) fn apply(&self, content: &mut Vec<u8>) {
        match self {
            Self::Write { at, bytes, .. } => write_into(content, *at, bytes),
            Self::Resize { size, .. } => content.resize(*size, 0),
            _ => {}
        }
    }
}

enum Node {
    File(Vec<u8>),
    Folder(BTreeMap<String, u64>),
}

/// Files and folders by number, and all changes.
pub(super) struct Disk {
    nodes: BTreeMap<u64, (Node, u32)>,
    pub(super) log: Vec<Change>,
}

impl Disk {
    pub(super) fn new() -> Self {
        let root = (Node::Folder(BTreeMap::new()), FOLDER | 0o755);
        Self { nodes: BTreeMap::from([(ROOT, root)]), log: Vec::new() }
    }

    /// Executes a request of the kernel. `None`: no answer is expected.
    pub(super) fn answer(&mut self, request: &Request<'_>) -> Option<Result<Answer, Errno>> {
        Some(match *request {
            Request::Forget => return None,
            Request::Init => Ok(Answer::init()),
            Request::Lookup { folder, name } => {
                self.find(folder, name).map(|found| Answer::entry(self.attributes(found)))
            }
            Request::Attributes { node } => Ok(Answer::attributes(self.attributes(node))),
            Request::Resize { node, size, mode } => {
                self.resize(node, size, mode);
                Ok(Answer::attributes(self.attributes(node)))
            }
            Request::MakeFolder { folder, name, mode } => self.create(folder, name, mode, true).map(Answer::entry),
            Request::MakeFile { folder, name, mode, is_opened } => {
                self.create(folder, name, mode, false).map(|found| {
                    let entry = Answer::entry(found);
                    if is_opened { entry.opened() } else { entry }
                })
            }
            Request::Remove { folder, name, is_folder } => self.remove(folder, name, is_folder),
            Request::Rename { folder, name, to_folder, to_name } => self.rename(folder, name, to_folder, to_name),
            Request::Open => Ok(Answer::default().opened()),
            Request::Read { node, at, size } => {
                let bytes = self.file(node);
                let begin = bytes.len().min(at as usize);
                Ok(Answer::default().bytes(&bytes[begin..bytes.len().min(begin + size as usize)]))
            }
            Request::Write { node, at, bytes } => {
                self.write(node, at as usize, bytes);
                Ok(Answer::default().u32s(&[bytes.len() as u32, 0]))
            }
            Request::Capacity => Ok(Answer::capacity()),
            Request::Done => Ok(Answer::default()),
            Request::SyncFile { node } => {
                self.log.push(Change::SyncFile { node });
                Ok(Answer::default())
            }
            Request::SyncFolder { node } => {
                self.log.push(Change::SyncFolder { node });
                Ok(Answer::default())
            }
            Request::List { node, at, size } => Ok(self.list(node, at, size as usize)),
            Request::Unknown => Err(Errno::NotImplemented),
        })
    }

    fn folder(&mut self, node: u64) -> Result<&mut BTreeMap<String, u64>, Errno> {
        match self.nodes.get_mut(&node) {
            Some((Node::Folder(entries), _)) => Ok(entries),
            _ => Err(Errno::NotADirectory),
        }
    }

    fn file(&mut self, node: u64) -> &mut Vec<u8> {
        match self.nodes.get_mut(&node) {
            Some((Node::File(bytes), _)) => bytes,
            _ => panic!("node {node} is not a file: the kernel reads and writes files only"),
        }
    }

    fn find(&mut self, folder: u64, name: &str) -> Result<u64, Errno> {
        self.folder(folder)?.get(name).copied().ok_or(Errno::NoEntry)
    }

    fn attributes(&self, node: u64) -> Attributes {
        let (content, mode) = &self.nodes[&node];
        let size = if let Node::File(bytes) = content { bytes.len() as u64 } else { 0 };
        Attributes { node, size, mode: *mode }
    }

    fn create(&mut self, folder: u64, name: &str, mode: u32, is_folder: bool) -> Result<Attributes, Errno> {
        // A removed node may still be open, so its number is not reused.
        let node = self.nodes.keys().next_back().map_or(ROOT, |last| last + 1);
        if self.folder(folder)?.insert(name.to_owned(), node).is_some() {
            return Err(Errno::Exists);
        }
        let mode = mode & 0o7777;
        let content = if is_folder { Node::Folder(BTreeMap::new()) } else { Node::File(Vec::new()) };
        self.nodes.insert(node, (content, mode | if is_folder { FOLDER } else { FILE }));
        self.log.push(Change::Create { folder, name: name.to_owned(), node, is_folder, mode });
        Ok(self.attributes(node))
    }

    fn remove(&mut self, folder: u64, name: &str, is_folder: bool) -> Result<Answer, Errno> {
        let node = self.find(folder, name)?;
        if is_folder && !self.folder(node)?.is_empty() {
            return Err(Errno::NotEmpty);
        }
        self.folder(folder)?.remove(name);
        self.log.push(Change::Remove { folder, name: name.to_owned() });
        Ok(Answer::default())
    }

    fn rename(&mut self, folder: u64, name: &str, to_folder: u64, to_name: &str) -> Result<Answer, Errno> {
        // The result of a crash during a rename between folders depends on the file system; the programs have no such
        // rename.
        if folder != to_folder {
            return Err(Errno::NotImplemented);
        }
        let node = self.find(folder, name)?;
        let entries = self.folder(folder)?;
        entries.remove(name);
        entries.insert(to_name.to_owned(), node);
        self.log.push(Change::Rename { folder, name: name.to_owned(), to_name: to_name.to_owned(), node });
        Ok(Answer::default())
    }

    fn resize(&mut self, node: u64, size: Option<u64>, mode: Option<u32>) {
        if let Some(size) = size {
            self.file(node).resize(size as usize, 0);
            self.log.push(Change::Resize { node, size: size as usize });
        }
        if let (Some(mode), Some((_, current))) = (mode, self.nodes.get_mut(&node)) {
            *current = *current & !0o7777 | mode & 0o7777;
        }
    }

    fn write(&mut self, node: u64, at: usize, bytes: &[u8]) {
        write_into(self.file(node), at, bytes);
        self.log.push(Change::Write { node, at, bytes: bytes.to_vec() });
    }

    fn list(&mut self, node: u64, at: u64, size: usize) -> Answer {
        let entries: Vec<(String, u64)> =
            self.folder(node).map(|entries| entries.clone().into_iter().collect()).unwrap_or_default();
        let mut answer = Answer::default();
        for (index, (name, node)) in entries.iter().enumerate().skip(at as usize) {
            let (longer, is_in) = answer.listed(size, index as u64 + 1, name, self.attributes(*node));
            answer = longer;
            if !is_in {
                break;
            }
        }
        answer
    }
}

/// Writes at an offset; a gap is filled with zeros.
pub(super) fn write_into(content: &mut Vec<u8>, at: usize, bytes: &[u8]) {
    if content.len() < at + bytes.len() {
        content.resize(at + bytes.len(), 0);
    }
    content[at..at + bytes.len()].copy_from_slice(bytes);
}
