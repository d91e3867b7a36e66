//! The possible contents of the disk after a power loss.
//!
//! Synced data is durable: the content of a file before its last `fsync`, the entries of a folder before the last
//! `fsync` of the folder. Of the later changes, each file and each folder may have any part: nothing, some, all.
//! Syncing a file does not make its name durable.

use super::disk::{Change, ROOT, write_into};
use random::Random;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// The part of the unsynced changes that survives.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub enum Survives {
    /// Neither names nor content.
    Nothing,
    /// All names, no content: the file exists and is empty.
    Names,
    /// All content, no names.
    Content,
    /// All names, the sizes of files, zeros as content.
    Zeros,
    /// All names, half of the changes of each file.
    Half,
    /// Everything, as after a kill of all processes.
    Everything,
    /// The first changes of each folder and any changes of each file, randomly chosen.
    Mixed(u64),
}

/// All variants except [`Survives::Mixed`].
const PLAIN: [Survives; 6] =
    [Survives::Nothing, Survives::Names, Survives::Content, Survives::Zeros, Survives::Half, Survives::Everything];

/// Files by path, and folders, each with its permissions.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tree {
    files: BTreeMap<PathBuf, (Vec<u8>, u32)>,
    folders: BTreeMap<PathBuf, u32>,
}

impl Tree {
    /// Replaces the folder by this content.
    pub fn write(&self, folder: &Path) {
        fs::remove_dir_all(folder).expect("removed");
        fs::create_dir(folder).expect("a folder");
        let mode = |path: &Path, mode| fs::set_permissions(path, PermissionsExt::from_mode(mode)).expect("set");
        for (path, permissions) in &self.folders {
            fs::create_dir(folder.join(path)).expect("a folder");
            mode(&folder.join(path), *permissions);
        }
        for (path, (bytes, permissions)) in &self.files {
            fs::write(folder.join(path), bytes).expect("written");
            mode(&folder.join(path), *permissions);
        }
    }
    /// The content of a file.
    pub fn file(&self, path: &str) -> Option<&[u8]> {
        self.files.get(Path::new(path)).map(|(bytes, _)| bytes.as_slice())
    }
    /// Paths of all files.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.files.keys().map(PathBuf::as_path)
    }
}

/// The changes of a run, in their order.
pub struct Journal {
    log: Vec<Change>,
    /// Changes of the content or entries of each file or folder, and its syncs, by its number.
    of_node: BTreeMap<u64, Vec<usize>>,
    /// For each number, whether it is a folder, and its permissions.
    created: BTreeMap<u64, (bool, u32)>,
}

impl Journal {
    pub(super) fn new(log: Vec<Change>) -> Self {
        let mut of_node = BTreeMap::<u64, Vec<usize>>::new();
        let mut created = BTreeMap::new();
        for (index, change) in log.iter().enumerate() {
            if let Change::Create { node, is_folder, mode, .. } = change {
                created.insert(*node, (*is_folder, *mode));
            }
            of_node.entry(change.changed()).or_default().push(index);
        }
        Self { log, of_node, created }
    }

    /// Number of changes and syncs.
    pub fn n_changes(&self) -> usize {
        self.log.len()
    }

    /// Number of syncs of files and of folders.
    pub fn n_syncs(&self) -> usize {
        self.log.iter().filter(|change| change.is_sync()).count()
    }

    /// Moments and survivals that leave different disks: before each sync, removal and rename, and at the end. The
    /// random survival is drawn `n_mixed` times at each moment.
    pub fn crashes(&self, n_mixed: u64) -> Vec<(usize, Survives)> {
        let is_moment = |change: &Change| !matches!(change, Change::Write { .. } | Change::Resize { .. });
        let moments = (0..self.log.len()).filter(|moment| is_moment(&self.log[*moment])).chain([self.log.len()]);
        let crashes = moments.flat_map(|moment| {
            let mixed = (0..n_mixed).map(move |draw| Survives::Mixed(moment as u64 * n_mixed + draw));
            PLAIN.into_iter().chain(mixed).map(move |survives| (moment, survives))
        });
        let mut seen = BTreeSet::new();
        crashes.filter(|(moment, survives)| seen.insert(self.fingerprint(*moment, *survives))).collect()
    }

    /// The disk after a power loss before change `moment`.
    pub fn after(&self, moment: usize, survives: Survives) -> Tree {
        let mut tree = Tree { files: BTreeMap::new(), folders: BTreeMap::new() };
        Crash { journal: self, moment, survives }.collect(ROOT, Path::new(""), &mut |path, kept, mode| match kept {
            Some(kept) => drop(tree.files.insert(path.to_owned(), (self.content(&kept), mode))),
            None => drop(tree.folders.insert(path.to_owned(), mode)),
        });
        tree
    }

    /// A value that is equal for equal disks, and nearly always different for different disks.
    fn fingerprint(&self, moment: usize, survives: Survives) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        let crash = Crash { journal: self, moment, survives };
        crash.collect(ROOT, Path::new(""), &mut |path, kept, _| (path, kept).hash(&mut hasher));
        hasher.finish()
    }

    /// The content of a file.
    fn content(&self, kept: &Kept<'_>) -> Vec<u8> {
        let mut content = Vec::new();
        let apply = |changes: &[usize], content: &mut Vec<u8>| {
            for index in changes {
                self.log[*index].apply(content);
            }
        };
        apply(kept.synced, &mut content);
        match kept.survives {
            Survives::Nothing | Survives::Names => {}
            Survives::Content | Survives::Everything | Survives::Mixed(_) => apply(kept.later, &mut content),
            Survives::Zeros => {
                let known = content.len();
                apply(kept.later, &mut content);
                content.iter_mut().skip(known).for_each(|byte| *byte = 0);
            }
            Survives::Half => {
                let (whole, rest) = kept.later.split_at(kept.later.len() / 2);
                apply(whole, &mut content);
                // The next one is torn.
                if let Some(Change::Write { at, bytes, .. }) = rest.first().map(|index| &self.log[*index]) {
                    write_into(&mut content, *at, &bytes[..bytes.len() / 2]);
                }
            }
        }
        content
    }
}

/// The surviving changes of a file.
#[derive(Hash)]
struct Kept<'a> {
    /// Its changes up to its last sync; `later` has the later ones.
    synced: &'a [usize],
    later: &'a [usize],
    survives: Survives,
}

/// A power loss before change `moment`.
struct Crash<'a> {
    journal: &'a Journal,
    moment: usize,
    survives: Survives,
}

impl<'a> Crash<'a> {
    /// Calls `found` with each file and folder below a folder: the surviving changes of a file, and the permissions.
    fn collect(&self, folder: u64, path: &Path, found: &mut dyn FnMut(&Path, Option<Kept<'a>>, u32)) {
        for (name, node) in self.entries(folder) {
            let path = path.join(name);
            match self.journal.created[&node] {
                (true, mode) => {
                    found(&path, None, mode);
                    self.collect(node, &path, found);
                }
                (false, mode) => found(&path, Some(self.kept(node)), mode),
            }
        }
    }

    /// The entries of a folder.
    fn entries(&self, folder: u64) -> BTreeMap<String, u64> {
        let (synced, later) = self.split(folder);
        let n_survivors = match self.survives {
            Survives::Nothing | Survives::Content => 0,
            Survives::Mixed(seed) => Random::for_stream(seed, folder).index(later.len() + 1),
            _ => later.len(),
        };
        let mut entries = BTreeMap::new();
        for index in synced.iter().chain(&later[..n_survivors]) {
            match &self.journal.log[*index] {
                Change::Create { name, node, .. } => drop(entries.insert(name.clone(), *node)),
                Change::Remove { name, .. } => drop(entries.remove(name)),
                Change::Rename { name, to_name, node, .. } => {
                    entries.remove(name);
                    entries.insert(to_name.clone(), *node);
                }
                _ => {}
            }
        }
        entries
    }

    fn kept(&self, file: u64) -> Kept<'a> {
        let (synced, later) = self.split(file);
        let survives = match self.survives {
            Survives::Mixed(seed) => *Random::for_stream(seed, file).pick(&PLAIN),
            survives => survives,
        };
        // Synced changes survive in any case.
        Kept { synced, later, survives: if later.is_empty() { Survives::Nothing } else { survives } }
    }

    /// The changes of a file or folder up to its last sync before the power loss, and the later ones.
    fn split(&self, node: u64) -> (&'a [usize], &'a [usize]) {
        let changes: &[usize] = self.journal.of_node.get(&node).map_or(&[], Vec::as_slice);
        let changes = &changes[..changes.partition_point(|index| *index < self.moment)];
        let synced = changes.iter().rposition(|index| self.journal.log[*index].is_sync());
        changes.split_at(synced.map_or(0, |last| last + 1))
    }
}
