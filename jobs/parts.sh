# For other scripts: one job run part by part, and the parts' tables joined to one. Sourced in the repository's root with
#   job      name of the job; part A,B leaves out/JOB_A_B, which keeps what is done
#   labels   names of the table's first columns, one for each A,B
#   columns  variables of the others
# Needs the environment of jobs/quickstart.sh.
PATH=$PWD/.venv/bin:$PATH
table=jobs/results/$job.csv
rm -f "$table.part"

part() { # VALUES-OF-LABELS SETTINGS...
  local values=$1
  local name=${job}_${values//,/_}
  shift
  cvt-hpc run "jobs/$job.toml" --set name="$name" "$@" > /dev/null
  python jobs/tabulate.py "out/$name" "out/$name/table.csv" "${columns[@]}" > /dev/null
  [ -s "$table.part" ] || sed -n "1s/^/$labels,/p" "out/$name/table.csv" > "$table.part"
  sed -n "2,\$s/^/$values,/p" "out/$name/table.csv" >> "$table.part"
}

joined() { # all parts are done
  mv "$table.part" "$table"
}
