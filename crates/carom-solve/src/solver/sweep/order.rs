//! In which order contacts are swept: a matter of the problem alone, never of the threads.

use crate::problem::BlockMatrix;
use std::collections::VecDeque;

/// Contacts in chunks, chunks in stages. Chunks of one stage do not feel each other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Order {
    /// Contacts of the chunks, one chunk after the other; inside a chunk in ascending order.
    pub contacts: Vec<u32>,
    /// Chunk `c` has contacts `chunks[c]..chunks[c + 1]`.
    pub chunks: Vec<usize>,
    /// Stage `k` has chunks `stages[k]..stages[k + 1]`.
    pub stages: Vec<usize>,
}

impl Order {
    /// One chunk with all contacts as they come.
    pub fn natural(count: usize) -> Order {
        Order {
            contacts: (0..count as u32).collect(),
            chunks: vec![0, count],
            stages: vec![0, 1],
        }
    }

    /// Chunks of up to `size` contacts that are near each other in the graph of `w`, coloured by first fit. O(blocks of `w`).
    pub fn coloured(w: &BlockMatrix, size: usize) -> Order {
        let (grown, starts) = grow(w, size);
        let count = starts.len() - 1;
        let mut chunk_of = vec![0u32; w.len()];
        for c in 0..count {
            for &i in &grown[starts[c]..starts[c + 1]] {
                chunk_of[i as usize] = c as u32;
            }
        }
        // First fit: the least colour that no neighbour has. `seen[colour]` is the last chunk with such a neighbour.
        let mut colour_of = vec![usize::MAX; count];
        let mut seen: Vec<usize> = Vec::new();
        for c in 0..count {
            for &i in &grown[starts[c]..starts[c + 1]] {
                for &j in &w.col[w.ptr[i as usize]..w.ptr[i as usize + 1]] {
                    if let Some(mark) = seen.get_mut(colour_of[chunk_of[j as usize] as usize]) {
                        *mark = c;
                    }
                }
            }
            let free = seen.iter().position(|&mark| mark != c);
            colour_of[c] = free.unwrap_or(seen.len());
            if free.is_none() {
                seen.push(usize::MAX);
            }
        }
        let mut stages = vec![0; seen.len() + 1];
        for &colour in &colour_of {
            stages[colour + 1] += 1;
        }
        for k in 1..stages.len() {
            stages[k] += stages[k - 1];
        }
        let mut by_colour: Vec<usize> = (0..count).collect();
        by_colour.sort_by_key(|&c| colour_of[c]);
        let (mut contacts, mut chunks) = (Vec::with_capacity(w.len()), vec![0]);
        for c in by_colour {
            contacts.extend_from_slice(&grown[starts[c]..starts[c + 1]]);
            chunks.push(contacts.len());
        }
        Order {
            contacts,
            chunks,
            stages,
        }
    }
}

/// Chunks of `size` contacts, the last may have fewer: each grows breadth first from where the ones before have ended.
fn grow(w: &BlockMatrix, size: usize) -> (Vec<u32>, Vec<usize>) {
    let count = w.len();
    let size = size.max(1);
    let mut taken = vec![false; count];
    let mut contacts: Vec<u32> = Vec::with_capacity(count);
    let mut starts = vec![0];
    // Contacts met by former chunks and by this one; an entry may have been taken since.
    let (mut border, mut near) = (VecDeque::<u32>::new(), VecDeque::<u32>::new());
    let mut next = 0;
    while contacts.len() < count {
        let first = contacts.len();
        while contacts.len() < (first + size).min(count) {
            let i = near
                .pop_front()
                .or_else(|| border.pop_front())
                .unwrap_or_else(|| {
                    while taken[next] {
                        next += 1;
                    }
                    next as u32
                });
            if taken[i as usize] {
                continue;
            }
            taken[i as usize] = true;
            contacts.push(i);
            let row = &w.col[w.ptr[i as usize]..w.ptr[i as usize + 1]];
            near.extend(row.iter().filter(|&&j| !taken[j as usize]));
        }
        border.append(&mut near);
        contacts[first..].sort_unstable();
        starts.push(contacts.len());
    }
    (contacts, starts)
}
