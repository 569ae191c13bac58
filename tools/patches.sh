#!/usr/bin/env bash
# Makes the patches of docs/guides/extend.md again where they no longer apply: tools/patches.sh
#
# Each patch becomes a commit on the version that it was last made for, and git carries that commit to HEAD, through files
# that were moved too. Commit the change of the code first. A conflict leaves its tree behind: resolve it there by hand.
set -euo pipefail
cd "$(dirname "$0")/.."
for patch in docs/guides/*.patch; do
    git apply --check "$patch" 2>/dev/null && continue
    made_for=$(git log -1 --format=%H -- "$patch")
    tree=$(mktemp -d)/tree
    git worktree add --quiet --detach "$tree" "$made_for"
    carry() { git -C "$tree" -c core.hooksPath=/dev/null "$@"; }
    # Patches from before they were checked strictly need patch(1), which tolerates displaced lines.
    carry apply --index "$PWD/$patch" 2>/dev/null || {
        patch --quiet --no-backup-if-mismatch -p1 -d "$tree" <"$patch"
        carry add --all
    }
    carry commit --quiet --no-verify -m "$patch"
    if ! carry rebase --quiet --onto "$(git rev-parse HEAD)" HEAD^ >/dev/null; then
        echo "$patch: conflicts. In $tree: mend them, git rebase --continue, git diff HEAD^ >$PWD/$patch," >&2
        echo "    and here: git worktree remove $tree" >&2
        exit 1
    fi
    carry diff HEAD^ >"$patch"
    git worktree remove "$tree"
    echo "$patch: made again"
done
