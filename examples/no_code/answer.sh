#!/bin/sh
# Fills an exported folder: sh answer.sh FOLDER. Any program in any language could do this, on any machine.
set -eu
here=$(dirname "$0")
for content in "$1"/content/*.bvh; do
  awk -f "$here/lean.awk" "$content" > "$1/answers/$(basename "$content")"
done
sed -i.bak 's/^name = .*/name = "lean-forward-awk"/; s/^title = .*/title = "lean forward (awk)"/' "$1/submission.toml"
