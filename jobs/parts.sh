# For other scripts: one job run part by part, and the parts' tables joined to one. Sourced in the repository's root with
#   job      name of the job; part A,B leaves $out/JOB_A_B, which keeps what is done
#   labels   names of the table's first columns, one for each A,B
#   columns  variables of the others
#   $1, $2   folder of the runs and the table: by default out, and that of the script's name in jobs/results
# Needs the environment of jobs/quickstart.sh.
out=${1:-out}
table=${2:-jobs/results/$(basename "$0" .sh).csv}
rm -f "$table.part" "$table.origin"
PATH=$PWD/.venv/bin:$PATH

part() { # VALUES-OF-LABELS SETTINGS...
  local values=$1
  local name=${job}_${values//,/_}
  shift
  cvt-hpc run "jobs/$job.toml" --set name="$name" --out "$out/$name" "$@" > /dev/null
  rows_of "$values" "$out/$name"
}

rows_of() { # VALUES-OF-LABELS FOLDER-OF-A-STUDY
  python jobs/tabulate.py "$2" "$2/table.csv" "${columns[@]}" > /dev/null
  grep '^#' "$2/table.csv" >> "$table.origin"
  [ -s "$table.part" ] || sed "/^#/d; s/^/$labels,/; q" "$2/table.csv" > "$table.part"
  sed "/^#/d" "$2/table.csv" | sed "1d; s/^/$1,/" >> "$table.part"
}

joined() { # all parts are done; of their origins each line once, but the machine's speed, which differs a little
  awk '!seen[$0]++ && !(/^# machine: .* take / && machine++)' "$table.origin" > "$table.whole"
  cat "$table.part" >> "$table.whole"
  mv "$table.whole" "$table"
  rm "$table.part" "$table.origin"
}
