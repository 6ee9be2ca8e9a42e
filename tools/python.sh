#!/usr/bin/env bash
# Print the first Python that is new enough; nothing, and status 1, where there is none.
for python in python3.13 python3.12 python3.11 python3; do
  if "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then
    echo "$python"
    exit 0
  fi
done
exit 1
