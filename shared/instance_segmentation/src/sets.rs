//! Disjoint sets.

/// Disjoint sets, each named by its first member.
pub(crate) struct Sets {
    /// A member of the same set that is not later.
    pub(crate) parents: Vec<u32>,
}

/// Numbers of disjoint sets, from 0.
pub(crate) struct SetNumbers {
    /// Number of the set of each member.
    pub(crate) by_member: Vec<u32>,
    /// Number of sets.
    pub(crate) n: usize,
}

impl Sets {
    pub(crate) fn new(n: usize) -> Self {
        Self { parents: (0..n as u32).collect() }
    }
    pub(crate) fn find(&mut self, member: usize) -> usize {
        let mut at = member;
        while self.parents[at] as usize != at {
            self.parents[at] = self.parents[self.parents[at] as usize];
            at = self.parents[at] as usize;
        }
        at
    }
    pub(crate) fn union(&mut self, a: usize, b: usize) {
        let a = self.find(a);
        self.union_firsts(a, b);
    }
    /// Joins the set with first member `first` and the set of `member`. Returns the first member of the union.
    pub(crate) fn union_firsts(&mut self, first: usize, member: usize) -> usize {
        let other = self.find(member);
        let before = first.min(other);
        self.parents[first.max(other)] = before as u32;
        before
    }
    /// Numbers the sets in the order of first members.
    pub(crate) fn numbers(&mut self) -> SetNumbers {
        let mut numbers = vec![0; self.parents.len()];
        let mut n = 0;
        for member in 0..numbers.len() {
            let first = self.find(member);
            if first == member {
                numbers[member] = n;
                n += 1;
            } else {
                numbers[member] = numbers[first];
            }
        }
        SetNumbers { by_member: numbers, n: n as usize }
    }
}
